#pragma once

#include "server/numerics/builds/products.h"

/// Inverses of positive definite matrices: by the block sweep operator, and of the Cholesky factor.
namespace trammel {
namespace {

// A diagonal block of `size` <= kMaxBlock, factored: lower-triangular inverse and its transpose,
// zero-padded to kMaxBlock columns so that they can be packed.
struct Block {
  alignas(64) double inverse[kMaxBlock * kMaxBlock];    // W = L⁻¹, column-major
  alignas(64) double transpose[kMaxBlock * kMaxBlock];  // Wᵀ, column-major
  alignas(64) double packed[kMaxBlock * kMaxBlock];
};

// `lower`, leading dimension kMaxBlock, becomes its Cholesky factor. False where it is not positive
// definite.
bool factorise(Index size, double* lower, double* log_det) {
  const Index end = round_up(size, kLanes);
  for (Index j = 0; j < size; ++j) {
    double* column = lower + j * kMaxBlock;
    const double pivot = column[j];
    if (!(pivot > 0.0) || !(pivot < 1e300)) return false;
    *log_det += log(pivot);
    const Vec scale = broadcast(1.0 / __builtin_sqrt(pivot));
    const Index first = j / kLanes * kLanes;
    for (Index i = first; i < end; i += kLanes) store(column + i, load(column + i) * scale);
    for (Index c = j + 1; c < size; ++c) {
      const Vec factor = broadcast(column[c]);
      double* target = lower + c * kMaxBlock;
      for (Index i = c / kLanes * kLanes; i < end; i += kLanes)
        store(target + i, load(target + i) - factor * load(column + i));
    }
  }
  return true;
}

// Forward elimination of the identity gives row after row of the inverse, stored as columns of its
// transpose.
void invert(Index size, const double* lower, Block* block) {
  memset(block->transpose, 0, sizeof(block->transpose));
  memset(block->inverse, 0, sizeof(block->inverse));
  double* wt = block->transpose;
  for (Index k = 0; k < size; ++k) wt[k + k * kMaxBlock] = 1.0;
  for (Index k = 0; k < size; ++k) {
    double* row = wt + k * kMaxBlock;
    const Index stop = round_up(k + 1, kLanes);
    const Vec scale = broadcast(1.0 / lower[k + k * kMaxBlock]);
    for (Index i = 0; i < stop; i += kLanes) store(row + i, load(row + i) * scale);
    for (Index c = k + 1; c < size; ++c) {
      const Vec factor = broadcast(lower[c + k * kMaxBlock]);
      double* target = wt + c * kMaxBlock;
      for (Index i = 0; i < stop; i += kLanes)
        store(target + i, load(target + i) - factor * load(row + i));
    }
  }
  for (Index j = 0; j < size; ++j) {
    for (Index i = 0; i <= j; ++i) block->inverse[j + i * kMaxBlock] = wt[i + j * kMaxBlock];
  }
}

bool factor_block(Index size, const double* a, Index ld, Block* block, double* log_det) {
  alignas(64) double lower[kMaxBlock * kMaxBlock];
  const Index end = round_up(size, kLanes);
  for (Index j = 0; j < size; ++j) {
    for (Index i = 0; i < end; ++i)
      lower[i + j * kMaxBlock] = i < size && i >= j ? a[i + j * ld] : 0.0;
  }
  if (!factorise(size, lower, log_det)) return false;
  invert(size, lower, block);
  return true;
}

// out (rows x size) = packed_a (rows x size) * B, where `t` is Bᵀ with leading dimension kMaxBlock;
// B is upper or lower triangular, and the zero half is not multiplied.
template <bool kUpper>
void multiply_block(Index rows, Index size, const double* packed_a, const double* t,
                    double* packed_b, double* out, Index ldo) {
  const Index columns = round_up(size, kTileColumns);
  pack_columns_transposed(columns, size, t, kMaxBlock, packed_b);
  for (Index i = 0; i < rows; i += kTileRows) {
    for (Index j = 0; j < columns; j += kTileColumns) {
      const Index first = kUpper ? 0 : j;
      const Index depth = kUpper ? least(size, j + kTileColumns) : size - j;
      micro_tile<false>(depth, packed_a + i * size + first * kTileRows,
                        packed_b + j * size + first * kTileColumns, 1.0, out + i + j * ldo, ldo);
    }
  }
}

Index block_size(Index n) { return n <= 1000 ? 32 : n <= 3000 ? 48 : 96; }

struct Workspace {
  double *panel, *factor, *packed_a, *packed_b;
  Index rows;

  Workspace(double* work, Index padded)
      : panel(work),
        factor(panel + padded * kMaxBlock),
        packed_a(factor + padded * kMaxBlock),
        packed_b(packed_a + padded * kMaxBlock),
        rows(padded) {}
};

Index work_size(Index rows) { return 4 * kMaxBlock * padded_rows(rows); }

// Copies columns k to k + size of the symmetric matrix with the lower triangle `a` into the panel.
// The rows of the block itself become zero, so that the update does not change them.
void gather_columns(Index k, Index size, const double* a, Index ld, const Workspace& w) {
  const Index below = k + size;
  for (Index i = 0; i < k; ++i) {
    for (Index c = 0; c < size; ++c) w.panel[i + c * w.rows] = a[k + c + i * ld];
  }
  for (Index c = 0; c < size; ++c) {
    memset(w.panel + k + c * w.rows, 0, static_cast<size_t>(size) * sizeof(double));
    memcpy(w.panel + below + c * w.rows, a + below + (k + c) * ld,
           static_cast<size_t>(w.rows - below) * sizeof(double));
  }
}

// a -= A B of the packed panels, in the lower triangle from row `first` on: A holds rows from
// there, B all columns.
void subtract_product(Index first, Index size, const Workspace& w, double* a, Index ld) {
  for (Index i = first; i < w.rows; i += kTileRows) {
    for (Index j = 0; j < i + kTileRows; j += kTileColumns)
      micro_tile<true>(size, w.packed_a + (i - first) * size, w.packed_b + j * size, -1.0,
                       a + i + j * ld, ld);
  }
}

// The swept columns back into the lower triangle, and -D = -L⁻ᵀ L⁻¹ into the block itself.
void put_swept(Index k, Index size, const Block& block, const Workspace& w, double* a, Index ld) {
  for (Index i = 0; i < k; ++i) {
    for (Index c = 0; c < size; ++c) a[k + c + i * ld] = w.panel[i + c * w.rows];
  }
  for (Index c = 0; c < size; ++c) {
    memcpy(a + k + size + (k + c) * ld, w.panel + k + size + c * w.rows,
           static_cast<size_t>(w.rows - k - size) * sizeof(double));
    for (Index i = c; i < size; ++i) {
      double total = 0;
      for (Index m = i; m < size; ++m)
        total += block.inverse[m + i * kMaxBlock] * block.inverse[m + c * kMaxBlock];
      a[k + i + (k + c) * ld] = -total;
    }
  }
}

// The block sweep operator: with D = A_kk⁻¹, A_ij -= A_ik D A_kj, A_ik <- A_ik D, A_kk <- -D. After
// all blocks the swept part holds -M⁻¹. Each block costs one symmetric update of rank `size`, n³
// flops in all. The extra rows come out as Y M⁻¹ without a solve.
bool sweep(Index n, Index extra, double* a, Index ld, double* work, double* log_det) {
  const Index rows = padded_rows(n + extra);
  const Index step = block_size(n);
  Workspace w(work, rows);
  Block block;
  *log_det = 0;
  for (Index k = 0; k < n; k += step) {
    const Index size = least(step, n - k);
    if (!factor_block(size, a + k + k * ld, ld, &block, log_det)) return false;
    gather_columns(k, size, a, ld, w);
    pack_rows(rows, size, w.panel, rows, w.packed_a);
    multiply_block<true>(rows, size, w.packed_a, block.inverse, block.packed, w.factor,
                         rows);  // T = A_:k L⁻ᵀ
    pack_rows(rows, size, w.factor, rows, w.packed_a);
    pack_columns_transposed(rows, size, w.factor, rows, w.packed_b);
    subtract_product(0, size, w, a, ld);
    multiply_block<false>(rows, size, w.packed_a, block.transpose, block.packed, w.panel,
                          rows);  // A_:k D = T L⁻¹
    put_swept(k, size, block, w, a, ld);
  }
  return true;
}

// Rows k to k + size of the inverse root into `a`. Column j of the factor is row j of the update:
// L_kk⁻¹ X_kj = W_kj before k, L_kk⁻¹ of the identity in k, T_j = A_jk L_kk⁻ᵀ after k.
void put_rows_of_root(Index k, Index size, const Block& block, const Workspace& w, double* a,
                      Index ld) {
  const Index below = k + size;
  for (Index c = 0; c < size; ++c) {
    memcpy(w.factor + k + c * w.rows, block.transpose + c * kMaxBlock,
           static_cast<size_t>(size) * sizeof(double));
    for (Index i = 0; i <= k + c; ++i) a[k + c + i * ld] = w.factor[i + c * w.rows];
    memset(a + below + (k + c) * ld, 0, static_cast<size_t>(w.rows - below) * sizeof(double));
  }
}

// Forward elimination of [M | I] in place. The identity's columns are stored in place of the
// eliminated ones, so the lower triangle ends as L⁻¹. Rows above k are finished: only rows below
// are updated.
bool inverse_root(Index n, Index extra, double* a, Index ld, double* work, double* log_det) {
  const Index rows = padded_rows(n + extra);
  const Index step = block_size(n);
  Workspace w(work, rows);
  Block block;
  *log_det = 0;
  for (Index k = 0; k < n; k += step) {
    const Index size = least(step, n - k);
    const Index below = k + size;
    if (!factor_block(size, a + k + k * ld, ld, &block, log_det)) return false;
    gather_columns(k, size, a, ld, w);
    pack_rows(rows, size, w.panel, rows, w.packed_a);
    multiply_block<true>(rows, size, w.packed_a, block.inverse, block.packed, w.factor, rows);
    put_rows_of_root(k, size, block, w, a, ld);
    pack_columns_transposed(rows, size, w.factor, rows, w.packed_b);
    const Index first = below / kTileRows * kTileRows;
    for (Index c = 0; c < size; ++c)
      memset(w.factor + first + c * rows, 0, static_cast<size_t>(below - first) * sizeof(double));
    pack_rows(rows - first, size, w.factor + first, rows, w.packed_a);
    subtract_product(first, size, w, a, ld);
  }
  return true;
}

}  // namespace
}  // namespace trammel
