#pragma once

#include "server/numerics/builds/vectors.h"

/// Products of matrices: of tiles that stay in registers, and of columns.
namespace trammel {
namespace {

// Panels: `a` holds kTileRows consecutive rows, depth after depth; `b` kTileColumns consecutive
// columns likewise. c(kTileRows x kTileColumns) = kKeep * c + sign * a b.
template <bool kKeep>
inline void micro_tile(Index depth, const double* a, const double* b, double sign, double* c,
                       Index ldc) {
  Vec total[kTileColumns][kTileVectors] = {};
  if constexpr (kKeep) {
    for (Index j = 0; j < kTileColumns; ++j) {
      for (Index v = 0; v < kTileVectors; ++v) __builtin_prefetch(c + j * ldc + v * kLanes, 1);
    }
  }
  for (Index k = 0; k < depth; ++k) {
    Vec x[kTileVectors];
#pragma GCC unroll 3
    for (Index v = 0; v < kTileVectors; ++v) x[v] = load(a + v * kLanes);
#pragma GCC unroll 8
    for (Index j = 0; j < kTileColumns; ++j) {
      const Vec y = broadcast(b[j]);
#pragma GCC unroll 3
      for (Index v = 0; v < kTileVectors; ++v) total[j][v] += x[v] * y;
    }
    a += kTileRows;
    b += kTileColumns;
  }
  const Vec factor = broadcast(sign);
#pragma GCC unroll 8
  for (Index j = 0; j < kTileColumns; ++j) {
#pragma GCC unroll 3
    for (Index v = 0; v < kTileVectors; ++v) {
      double* p = c + j * ldc + v * kLanes;
      if constexpr (kKeep) {
        store(p, load(p) + factor * total[j][v]);
      } else {
        store(p, factor * total[j][v]);
      }
    }
  }
}

// rows x depth, column-major, rows a multiple of kTileRows.
void pack_rows(Index rows, Index depth, const double* a, Index lda, double* packed) {
  for (Index i = 0; i < rows; i += kTileRows) {
    for (Index k = 0; k < depth; ++k, packed += kTileRows) {
      for (Index v = 0; v < kTileVectors; ++v)
        store(packed + v * kLanes, load(a + i + v * kLanes + k * lda));
    }
  }
}

// The transpose of a column-major cols x depth array, i.e. element (k, j) is t[j + k * ldt].
void pack_columns_transposed(Index cols, Index depth, const double* t, Index ldt, double* packed) {
  for (Index j = 0; j < cols; j += kTileColumns) {
    for (Index k = 0; k < depth; ++k, packed += kTileColumns) {
      for (Index c = 0; c < kTileColumns; ++c) packed[c] = t[j + c + k * ldt];
    }
  }
}

Index multiply_work_size(Index rows, Index cols) {
  return kMaxBlock * (padded_rows(rows) + padded_rows(cols));
}

void multiply_transposed(Index rows, Index cols, Index depth, double sign, const double* a,
                         Index lda, const double* b, Index ldb, bool lower_only, double* c,
                         Index ldc, double* work) {
  const Index row_end = round_up(rows, kTileRows);
  const Index col_end = round_up(cols, kTileColumns);
  double* packed_a = work;
  double* packed_b = work + row_end * kMaxBlock;
  for (Index k = 0; k < depth; k += kMaxBlock) {
    const Index size = least(kMaxBlock, depth - k);
    pack_rows(row_end, size, a + k * lda, lda, packed_a);
    pack_columns_transposed(col_end, size, b + k * ldb, ldb, packed_b);
    for (Index i = 0; i < row_end; i += kTileRows) {
      const Index stop = lower_only ? least(col_end, i + kTileRows) : col_end;
      for (Index j = 0; j < stop; j += kTileColumns)
        micro_tile<true>(size, packed_a + i * size, packed_b + j * size, sign, c + i + j * ldc,
                         ldc);
    }
  }
}

// ---- of columns: c(i, j) = Σ_r a(r, i) b(r, j)
// ------------------------------------------------------------------

constexpr Index kColumnBlock = 4;  // columns of either side that are in registers together
constexpr Index kStrip =
    1024;  // rows at a time, so that eight columns stay in the first-level cache

// c += AᵀB for M columns of a, N of b and `rows` rows.
template <Index M, Index N>
inline void add_column_block(Index rows, const double* a, Index lda, const double* b, Index ldb,
                             double* c, Index ldc) {
  Vec sums[M][N] = {};
  Index r = 0;
  for (; r + kLanes <= rows; r += kLanes) {
    Vec left[M];
    for (Index i = 0; i < M; ++i) left[i] = load(a + i * lda + r);
    for (Index j = 0; j < N; ++j) {
      const Vec right = load(b + j * ldb + r);
      for (Index i = 0; i < M; ++i) sums[i][j] += left[i] * right;
    }
  }
  for (Index j = 0; j < N; ++j) {
    for (Index i = 0; i < M; ++i) {
      double total = sum(sums[i][j]);
      for (Index rest = r; rest < rows; ++rest) total += a[i * lda + rest] * b[j * ldb + rest];
      c[i + j * ldc] += total;
    }
  }
}

template <Index M>
inline void add_column_blocks(Index rows, const double* a, Index lda, Index n, const double* b,
                              Index ldb, double* c, Index ldc) {
  Index j = 0;
  for (; j + kColumnBlock <= n; j += kColumnBlock)
    add_column_block<M, kColumnBlock>(rows, a, lda, b + j * ldb, ldb, c + j * ldc, ldc);
  for (; j < n; ++j) add_column_block<M, 1>(rows, a, lda, b + j * ldb, ldb, c + j * ldc, ldc);
}

void transposed_product(Index k, Index m, const double* a, Index lda, Index n, const double* b,
                        Index ldb, double* c, Index ldc) {
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < m; ++i) c[i + j * ldc] = 0;
  }
  for (Index first = 0; first < k; first += kStrip) {
    const Index rows = least(k - first, kStrip);
    Index i = 0;
    for (; i + kColumnBlock <= m; i += kColumnBlock)
      add_column_blocks<kColumnBlock>(rows, a + i * lda + first, lda, n, b + first, ldb, c + i,
                                      ldc);
    for (; i < m; ++i)
      add_column_blocks<1>(rows, a + i * lda + first, lda, n, b + first, ldb, c + i, ldc);
  }
}

}  // namespace
}  // namespace trammel
