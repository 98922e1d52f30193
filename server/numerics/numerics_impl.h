// Included once by each numerics_*.cpp, which sets the target and the vector width; see numerics.h for why nothing
// here may have external linkage but the one function at the end.

namespace trammel {
namespace {

using Index = ptrdiff_t;

constexpr Index kLanes = TRAMMEL_VECTOR_LANES;
constexpr Index kTileVectors = 3;                     // micro-tile rows, in vectors
constexpr Index kTileRows = kTileVectors * kLanes;    // 24, 12, 6: all divide kRowPadding
constexpr Index kTileColumns = TRAMMEL_TILE_COLUMNS;  // 8, 4, 4: accumulators fill the register file
constexpr Index kMaxBlock = 96;

typedef double Vec __attribute__((vector_size(kLanes * sizeof(double))));
typedef double Loose __attribute__((vector_size(kLanes * sizeof(double)), aligned(8), may_alias));
typedef long long Bits __attribute__((vector_size(kLanes * sizeof(double))));

inline Vec load(const double* p) { return *reinterpret_cast<const Loose*>(p); }
inline void store(double* p, Vec v) { *reinterpret_cast<Loose*>(p) = v; }
inline Vec broadcast(double x) { return Vec{} + x; }
// Masked, since the plain AVX-512 intrinsics of GCC 12 warn of an operand that they leave undefined.
#if TRAMMEL_VECTOR_LANES == 8
inline Vec largest(Vec a, Vec b) { return _mm512_maskz_max_pd(0xff, a, b); }
inline Vec square_root(Vec x) { return _mm512_maskz_sqrt_pd(0xff, x); }
#elif TRAMMEL_VECTOR_LANES == 4
inline Vec largest(Vec a, Vec b) { return _mm256_max_pd(a, b); }
inline Vec square_root(Vec x) { return _mm256_sqrt_pd(x); }
#else
inline Vec largest(Vec a, Vec b) { return _mm_max_pd(a, b); }
inline Vec square_root(Vec x) { return _mm_sqrt_pd(x); }
#endif
inline double sum(Vec v) {
  double total = 0;
  for (Index i = 0; i < kLanes; ++i) total += v[i];
  return total;
}
inline Index least(Index a, Index b) { return a < b ? a : b; }
inline Index round_up(Index n, Index step) { return (n + step - 1) / step * step; }

#if TRAMMEL_VECTOR_LANES == 8

// e^x for x <= 0, 1e-15 + |x| 1e-16 relative; below -708 it stays at e^-708, which is 0 for any sum here. x = n/8 ln 2
// + r, |r| <= ln 2 / 16: 2^(n/8) is one permutation of eight doubles and an integer addition, e^r a Chebyshev
// polynomial of degree 6. Adding 1.5 * 2^52 leaves n in the low bits of the mantissa; the table has n mod 8 taken off
// where n << 49 puts it.
inline Vec exp_of_negative(Vec x) {
  constexpr Bits kPowers = {0x3ff0000000000000, 0x3fef72b83c7d517b, 0x3fef06fe0a31b715, 0x3feebfdad5362a27,
                            0x3feea09e667f3bcd, 0x3feeace5422aa0db, 0x3feee89f995ad3ad, 0x3fef5818dcfba487};
  constexpr double kShift = 0x1.8p52;
  x = largest(x, broadcast(-708.0));
  const Vec shifted = x * 0x1.71547652b82fep+3 + kShift;
  const Vec r = x - (shifted - kShift) * 0x1.62e42fefa39efp-4;
  const Bits n = reinterpret_cast<Bits>(shifted);
  const Vec power = reinterpret_cast<Vec>(__builtin_shuffle(kPowers, n) + (n << 49));
  const Vec p = 0x1.0000000000000p+0 +
                r * (0x1.0000000000287p+0 +
                     r * (0x1.0000000000172p-1 +
                          r * (0x1.555555404e1f0p-3 +
                               r * (0x1.5555554650340p-5 + r * (0x1.111689121f9ffp-7 + r * 0x1.6c1d016b94860p-10)))));
  return p * power;
}

#else

// e^x for x <= 0, 4e-16 relative; below -708 it stays at e^-708, which is 0 for any sum here. x = n ln 2 + r, |r| <=
// ln 2 / 2, Chebyshev polynomial of degree 10 in r; adding 1.5 * 2^52 leaves n in the low bits of the mantissa.
inline Vec exp_of_negative(Vec x) {
  x = largest(x, broadcast(-708.0));
  constexpr double kShift = 0x1.8p52;
  const Vec shifted = x * 0x1.71547652b82fep+0 + kShift;
  const Vec n = shifted - kShift;
  const Vec r = (x - n * 0x1.62e42fefa0000p-1) - n * 0x1.cf79abc9e3b3ap-40;
  const Vec r2 = r * r;
  const Vec r4 = r2 * r2;
  const Vec p01 = 1.0 + r * 0x1.000000000001ep+0;
  const Vec p23 = 0x1.0000000000011p-1 + r * 0x1.555555554b74cp-3;
  const Vec p45 = 0x1.555555554f0c9p-5 + r * 0x1.1111112dd7cd0p-7;
  const Vec p67 = 0x1.6c16c187fd096p-10 + r * 0x1.a01978c2c19adp-13;
  const Vec p89 = 0x1.a01991a987b0ep-16 + r * 0x1.72faf41e9d7f6p-19;
  const Vec high = (p45 + r2 * p67) + r4 * (p89 + r2 * 0x1.28b408307df80p-22);
  const Vec p = (p01 + r2 * p23) + r4 * high;
  return reinterpret_cast<Vec>(reinterpret_cast<Bits>(p) + (reinterpret_cast<Bits>(shifted) << 52));
}

#endif

// ---- covariance ------------------------------------------------------------------------------------------------

// Value at h = r²/2 and, for the gradient, s(h) with dk/dlog l_d = s(h) (z_d - z'_d)².
struct SquaredExponential {
  static Vec value(Vec h) { return exp_of_negative(-h); }
  static Vec slope(Vec h) { return exp_of_negative(-h); }
};
struct Matern32 {
  static Vec value(Vec h) {
    const Vec t = square_root(6.0 * largest(h, Vec{}));
    return (1.0 + t) * exp_of_negative(-t);
  }
  static Vec slope(Vec h) { return 3.0 * exp_of_negative(-square_root(6.0 * largest(h, Vec{}))); }
};
struct Matern52 {
  static Vec value(Vec h) {
    const Vec t = square_root(10.0 * largest(h, Vec{}));
    return (1.0 + t + t * t * (1.0 / 3.0)) * exp_of_negative(-t);
  }
  static Vec slope(Vec h) {
    const Vec t = square_root(10.0 * largest(h, Vec{}));
    return (5.0 / 3.0) * (1.0 + t) * exp_of_negative(-t);
  }
};

// r²/2 = |z|²/2 + |z'|²/2 - z·z' for kCount vectors of rows at once; rounding may make it a little negative.
constexpr Index kUnroll = 4;

template <Index kCount>
[[gnu::always_inline]] inline void half_square_distance(Index dims, const double* a, Index lda, const double* b,
                                                        Index ldb, Vec* h) {
  const Vec half_b = broadcast(b[dims * ldb]);
  for (Index u = 0; u < kCount; ++u) h[u] = load(a + dims * lda + u * kLanes) + half_b;
  for (Index d = 0; d < dims; ++d) {
    const Vec z = broadcast(b[d * ldb]);
    for (Index u = 0; u < kCount; ++u) h[u] -= load(a + d * lda + u * kLanes) * z;
  }
}

template <typename Shape, Index kCount>
inline void tile_rows(Index dims, const double* a, Index lda, const double* b, Index ldb, double* k) {
  Vec h[kCount];
  half_square_distance<kCount>(dims, a, lda, b, ldb, h);
  for (Index u = 0; u < kCount; ++u) store(k + u * kLanes, Shape::value(h[u]));
}

template <typename Shape>
void tile(Index dims, Index rows, const double* a, Index lda, Index cols, const double* b, Index ldb, double* k,
          Index ldk) {
  const Index end = round_up(rows, kLanes);
  for (Index j = 0; j < cols; ++j) {
    Index i = 0;
    for (; i + kUnroll * kLanes <= end; i += kUnroll * kLanes)
      tile_rows<Shape, kUnroll>(dims, a + i, lda, b + j, ldb, k + i + j * ldk);
    for (; i < end; i += kLanes) tile_rows<Shape, 1>(dims, a + i, lda, b + j, ldb, k + i + j * ldk);
  }
}

template <typename Shape, Index kCount>
[[gnu::always_inline]] inline Vec weighted_rows(Index dims, const double* a, Index lda, const double* b, Index ldb,
                                                const double* weights) {
  Vec h[kCount];
  half_square_distance<kCount>(dims, a, lda, b, ldb, h);
  Vec total = {};
  for (Index u = 0; u < kCount; ++u) total += load(weights + u * kLanes) * Shape::value(h[u]);
  return total;
}

// Rows in chunks that stay in the first-level cache while every column passes over them.
template <typename Shape>
[[gnu::always_inline]] inline void weighted_sum_of(Index dims, Index rows, const double* a, Index lda, Index cols,
                                                   const double* b, Index ldb, const double* weights, double* out) {
  constexpr Index kChunk = 512;
  for (Index j = 0; j < cols; ++j) out[j] = 0;
  const Index end = round_up(rows, kLanes);
  for (Index start = 0; start < end; start += kChunk) {
    const Index stop = least(end, start + kChunk);
    for (Index j = 0; j < cols; ++j) {
      Vec total = {};
      Index i = start;
      for (; i + kUnroll * kLanes <= stop; i += kUnroll * kLanes)
        total += weighted_rows<Shape, kUnroll>(dims, a + i, lda, b + j, ldb, weights + i);
      for (; i < stop; i += kLanes) total += weighted_rows<Shape, 1>(dims, a + i, lda, b + j, ldb, weights + i);
      out[j] += sum(total);
    }
  }
}

// The loop over six joints is unrolled.
template <typename Shape>
void weighted_sum(Index dims, Index rows, const double* a, Index lda, Index cols, const double* b, Index ldb,
                  const double* weights, double* out) {
  if (dims == 6) return weighted_sum_of<Shape>(6, rows, a, lda, cols, b, ldb, weights, out);
  weighted_sum_of<Shape>(dims, rows, a, lda, cols, b, ldb, weights, out);
}

// With the number of joints known at compile time (kDims > 0) the squared differences and the totals stay in registers.
template <typename Shape, Index kDims>
void gradient_fixed(Index rows, const double* a, Index lda, Index cols, const double* b, Index ldb, const double* g,
                    Index ldg, double* gradient) {
  Vec total[kDims] = {};
  const Index end = round_up(rows, kLanes);
  for (Index j = 0; j < cols; ++j) {
    for (Index i = 0; i < end; i += kLanes) {
      Vec square[kDims];
      Vec h = {};
#pragma GCC unroll 8
      for (Index d = 0; d < kDims; ++d) {
        const Vec difference = load(a + i + d * lda) - b[j + d * ldb];
        square[d] = difference * difference;
        h += square[d];
      }
      const Vec weight = load(g + i + j * ldg) * Shape::slope(0.5 * h);
#pragma GCC unroll 8
      for (Index d = 0; d < kDims; ++d) total[d] += weight * square[d];
    }
  }
  for (Index d = 0; d < kDims; ++d) gradient[d] += sum(total[d]);
}

template <typename Shape>
void gradient_any(Index dims, Index rows, const double* a, Index lda, Index cols, const double* b, Index ldb,
                  const double* g, Index ldg, double* gradient) {
  const Index end = round_up(rows, kLanes);
  for (Index j = 0; j < cols; ++j) {
    for (Index i = 0; i < end; i += kLanes) {
      Vec h = {};
      for (Index d = 0; d < dims; ++d) {
        const Vec difference = load(a + i + d * lda) - b[j + d * ldb];
        h += difference * difference;
      }
      const Vec weight = load(g + i + j * ldg) * Shape::slope(0.5 * h);
      for (Index d = 0; d < dims; ++d) {
        const Vec difference = load(a + i + d * lda) - b[j + d * ldb];
        gradient[d] += sum(weight * difference * difference);
      }
    }
  }
}

template <typename Shape>
void gradient_tile(Index dims, Index rows, const double* a, Index lda, Index cols, const double* b, Index ldb,
                   const double* g, Index ldg, double* gradient) {
  switch (dims) {
    case 6:
      return gradient_fixed<Shape, 6>(rows, a, lda, cols, b, ldb, g, ldg, gradient);
    case 7:
      return gradient_fixed<Shape, 7>(rows, a, lda, cols, b, ldb, g, ldg, gradient);
    default:
      return gradient_any<Shape>(dims, rows, a, lda, cols, b, ldb, g, ldg, gradient);
  }
}

void radial_tile(RadialShape shape, Index dims, Index rows, const double* a, Index lda, Index cols, const double* b,
                 Index ldb, double* k, Index ldk) {
  switch (shape) {
    case RadialShape::kSquaredExponential:
      return tile<SquaredExponential>(dims, rows, a, lda, cols, b, ldb, k, ldk);
    case RadialShape::kMatern32:
      return tile<Matern32>(dims, rows, a, lda, cols, b, ldb, k, ldk);
    case RadialShape::kMatern52:
      return tile<Matern52>(dims, rows, a, lda, cols, b, ldb, k, ldk);
  }
}

void radial_gradient(RadialShape shape, Index dims, Index rows, const double* a, Index lda, Index cols, const double* b,
                     Index ldb, const double* g, Index ldg, double* gradient) {
  switch (shape) {
    case RadialShape::kSquaredExponential:
      return gradient_tile<SquaredExponential>(dims, rows, a, lda, cols, b, ldb, g, ldg, gradient);
    case RadialShape::kMatern32:
      return gradient_tile<Matern32>(dims, rows, a, lda, cols, b, ldb, g, ldg, gradient);
    case RadialShape::kMatern52:
      return gradient_tile<Matern52>(dims, rows, a, lda, cols, b, ldb, g, ldg, gradient);
  }
}

void radial_weighted_sum(RadialShape shape, Index dims, Index rows, const double* a, Index lda, Index cols,
                         const double* b, Index ldb, const double* weights, double* out) {
  switch (shape) {
    case RadialShape::kSquaredExponential:
      return weighted_sum<SquaredExponential>(dims, rows, a, lda, cols, b, ldb, weights, out);
    case RadialShape::kMatern32:
      return weighted_sum<Matern32>(dims, rows, a, lda, cols, b, ldb, weights, out);
    case RadialShape::kMatern52:
      return weighted_sum<Matern52>(dims, rows, a, lda, cols, b, ldb, weights, out);
  }
}

void weight_column(Index rows, double scale, const double* a, Index outputs, const double* alpha, Index ld_alpha,
                   const double* c, double* g) {
  for (Index i = 0; i < rows; ++i) g[i] = scale * a[i];
  for (Index d = 0; d < outputs; ++d)
    for (Index i = 0; i < rows; ++i) g[i] -= c[d] * alpha[i + d * ld_alpha];
}

// ---- dense algebra ---------------------------------------------------------------------------------------------

// Panels: `a` holds kTileRows consecutive rows, depth after depth; `b` kTileColumns consecutive columns likewise.
// c(kTileRows x kTileColumns) = kKeep * c + sign * a b.
template <bool kKeep>
inline void micro_tile(Index depth, const double* a, const double* b, double sign, double* c, Index ldc) {
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
      for (Index v = 0; v < kTileVectors; ++v) store(packed + v * kLanes, load(a + i + v * kLanes + k * lda));
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

// A diagonal block of `size` <= kMaxBlock, factored: lower-triangular inverse and its transpose, zero-padded to
// kMaxBlock columns so that they can be packed.
struct Block {
  alignas(64) double inverse[kMaxBlock * kMaxBlock];    // W = L⁻¹, column-major
  alignas(64) double transpose[kMaxBlock * kMaxBlock];  // Wᵀ, column-major
  alignas(64) double packed[kMaxBlock * kMaxBlock];
};

bool factor_block(Index size, const double* a, Index ld, Block* block, double* log_det) {
  alignas(64) double lower[kMaxBlock * kMaxBlock];
  const Index end = round_up(size, kLanes);
  for (Index j = 0; j < size; ++j) {
    for (Index i = 0; i < end; ++i) lower[i + j * kMaxBlock] = i < size && i >= j ? a[i + j * ld] : 0.0;
  }
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
      for (Index i = 0; i < stop; i += kLanes) store(target + i, load(target + i) - factor * load(row + i));
    }
  }
  for (Index j = 0; j < size; ++j) {
    for (Index i = 0; i <= j; ++i) block->inverse[j + i * kMaxBlock] = wt[i + j * kMaxBlock];
  }
  return true;
}

// out (rows x size) = packed_a (rows x size) * B, where `t` is Bᵀ with leading dimension kMaxBlock; B is upper or lower
// triangular, and the zero half is not multiplied.
template <bool kUpper>
void multiply_block(Index rows, Index size, const double* packed_a, const double* t, double* packed_b, double* out,
                    Index ldo) {
  const Index columns = round_up(size, kTileColumns);
  pack_columns_transposed(columns, size, t, kMaxBlock, packed_b);
  for (Index i = 0; i < rows; i += kTileRows) {
    for (Index j = 0; j < columns; j += kTileColumns) {
      const Index first = kUpper ? 0 : j;
      const Index depth = kUpper ? least(size, j + kTileColumns) : size - j;
      micro_tile<false>(depth, packed_a + i * size + first * kTileRows, packed_b + j * size + first * kTileColumns, 1.0,
                        out + i + j * ldo, ldo);
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

// The block sweep operator: with D = A_kk⁻¹, A_ij -= A_ik D A_kj, A_ik <- A_ik D, A_kk <- -D. After all blocks the
// swept part holds -M⁻¹. It is one symmetric update of rank `size` for each block, n³ flops in all, and the extra rows
// come out as Y M⁻¹ without a solve.
bool sweep(Index n, Index extra, double* a, Index ld, double* work, double* log_det) {
  const Index rows = padded_rows(n + extra);
  const Index step = block_size(n);
  Workspace w(work, rows);
  Block block;
  *log_det = 0;
  for (Index k = 0; k < n; k += step) {
    const Index size = least(step, n - k);
    if (!factor_block(size, a + k + k * ld, ld, &block, log_det)) return false;
    // The whole block column from the lower triangle; zero where k itself is, so that the update leaves it alone.
    for (Index i = 0; i < k; ++i) {
      for (Index c = 0; c < size; ++c) w.panel[i + c * rows] = a[k + c + i * ld];
    }
    for (Index c = 0; c < size; ++c) {
      memset(w.panel + k + c * rows, 0, static_cast<size_t>(size) * sizeof(double));
      memcpy(w.panel + k + size + c * rows, a + k + size + (k + c) * ld,
             static_cast<size_t>(rows - k - size) * sizeof(double));
    }
    pack_rows(rows, size, w.panel, rows, w.packed_a);
    multiply_block<true>(rows, size, w.packed_a, block.inverse, block.packed, w.factor, rows);  // T = A_:k L⁻ᵀ
    pack_rows(rows, size, w.factor, rows, w.packed_a);
    pack_columns_transposed(rows, size, w.factor, rows, w.packed_b);
    for (Index i = 0; i < rows; i += kTileRows) {
      for (Index j = 0; j < i + kTileRows; j += kTileColumns)
        micro_tile<true>(size, w.packed_a + i * size, w.packed_b + j * size, -1.0, a + i + j * ld, ld);
    }
    multiply_block<false>(rows, size, w.packed_a, block.transpose, block.packed, w.panel, rows);  // A_:k D = T L⁻¹
    for (Index i = 0; i < k; ++i) {
      for (Index c = 0; c < size; ++c) a[k + c + i * ld] = w.panel[i + c * rows];
    }
    for (Index c = 0; c < size; ++c) {
      memcpy(a + k + size + (k + c) * ld, w.panel + k + size + c * rows,
             static_cast<size_t>(rows - k - size) * sizeof(double));
      for (Index i = c; i < size; ++i) {
        double total = 0;  // D = L⁻ᵀ L⁻¹
        for (Index m = i; m < size; ++m) total += block.inverse[m + i * kMaxBlock] * block.inverse[m + c * kMaxBlock];
        a[k + i + (k + c) * ld] = -total;
      }
    }
  }
  return true;
}

// Forward elimination of [M | I] in place: what would be I's columns take the place of the eliminated ones, so the
// lower triangle ends as L⁻¹. Rows above k are finished: only rows below are updated.
bool inverse_root(Index n, Index extra, double* a, Index ld, double* work, double* log_det) {
  const Index rows = padded_rows(n + extra);
  const Index step = block_size(n);
  Workspace w(work, rows);
  Block block;
  *log_det = 0;
  for (Index k = 0; k < n; k += step) {
    const Index size = least(step, n - k);
    const Index below = k + size;
    const size_t bytes_below = static_cast<size_t>(rows - below) * sizeof(double);
    if (!factor_block(size, a + k + k * ld, ld, &block, log_det)) return false;
    for (Index i = 0; i < k; ++i) {
      for (Index c = 0; c < size; ++c) w.panel[i + c * rows] = a[k + c + i * ld];
    }
    for (Index c = 0; c < size; ++c) {
      memset(w.panel + k + c * rows, 0, static_cast<size_t>(size) * sizeof(double));
      memcpy(w.panel + below + c * rows, a + below + (k + c) * ld, bytes_below);
    }
    // Transposed, row j of the factor is column j of the update: L_kk⁻¹ X_kj = W_kj before k, L_kk⁻¹ of the identity in
    // k, T_j = A_jk L_kk⁻ᵀ after k.
    pack_rows(rows, size, w.panel, rows, w.packed_a);
    multiply_block<true>(rows, size, w.packed_a, block.inverse, block.packed, w.factor, rows);
    for (Index c = 0; c < size; ++c) {
      memcpy(w.factor + k + c * rows, block.transpose + c * kMaxBlock, static_cast<size_t>(size) * sizeof(double));
      for (Index i = 0; i <= k + c; ++i) a[k + c + i * ld] = w.factor[i + c * rows];
      memset(a + below + (k + c) * ld, 0, bytes_below);
    }
    pack_columns_transposed(rows, size, w.factor, rows, w.packed_b);
    const Index first = below / kTileRows * kTileRows;
    for (Index c = 0; c < size; ++c)
      memset(w.factor + first + c * rows, 0, static_cast<size_t>(below - first) * sizeof(double));
    pack_rows(rows - first, size, w.factor + first, rows, w.packed_a);
    for (Index i = first; i < rows; i += kTileRows) {
      for (Index j = 0; j < i + kTileRows; j += kTileColumns)
        micro_tile<true>(size, w.packed_a + (i - first) * size, w.packed_b + j * size, -1.0, a + i + j * ld, ld);
    }
  }
  return true;
}

Index multiply_work_size(Index rows, Index cols) { return kMaxBlock * (padded_rows(rows) + padded_rows(cols)); }

void multiply_transposed(Index rows, Index cols, Index depth, double sign, const double* a, Index lda, const double* b,
                         Index ldb, bool lower_only, double* c, Index ldc, double* work) {
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
        micro_tile<true>(size, packed_a + i * size, packed_b + j * size, sign, c + i + j * ldc, ldc);
    }
  }
}

Index packed_size(Index n) {
  Index total = 0;
  for (Index i = 0; i < n; i += kTileRows) total += kTileRows * least(n, i + kTileRows);
  return total;
}

void pack_lower(Index n, Index first, const double* a, Index ld, double* packed) {
  for (Index k = 0; k < least(n, first + kTileRows); ++k, packed += kTileRows) {
    for (Index r = 0; r < kTileRows; ++r) packed[r] = first + r < n && first + r >= k ? a[first + r + k * ld] : 0.0;
  }
}

// Row i of a triangle that is stored row after row starts here.
Index triangle_row(Index i) { return i * (i + 1) / 2; }

void pack_triangle(Index n, const double* triangle, double* packed) {
  for (Index i = 0; i < n; i += kTileRows) {
    const Index depth = least(n, i + kTileRows);
    for (Index r = 0; r < kTileRows; ++r) {
      const Index length = i + r < n ? i + r + 1 : 0;
      const double* row = triangle + triangle_row(i + r);
      for (Index k = 0; k < length; ++k) packed[k * kTileRows + r] = row[k];
      for (Index k = length; k < depth; ++k) packed[k * kTileRows + r] = 0.0;
    }
    packed += depth * kTileRows;
  }
}

void unpack_triangle(Index n, const double* packed, double* triangle) {
  for (Index i = 0; i < n; i += kTileRows) {
    for (Index r = 0; r < kTileRows && i + r < n; ++r) {
      double* row = triangle + triangle_row(i + r);
      for (Index k = 0; k <= i + r; ++k) row[k] = packed[k * kTileRows + r];
    }
    packed += least(n, i + kTileRows) * kTileRows;
  }
}

template <Index kCount>
void square_norms_of(Index n, const double* packed, const double* k, double* out) {
  Vec square[kCount] = {};
  for (Index i = 0; i < n; i += kTileRows) {
    const Index depth = least(n, i + kTileRows);
    Vec total[kCount][kTileVectors] = {};
    for (Index m = 0; m < depth; ++m, packed += kTileRows) {
      Vec x[kTileVectors];
#pragma GCC unroll 3
      for (Index v = 0; v < kTileVectors; ++v) x[v] = load(packed + v * kLanes);
#pragma GCC unroll 8
      for (Index j = 0; j < kCount; ++j) {
        const Vec y = broadcast(k[m * kCount + j]);
#pragma GCC unroll 3
        for (Index v = 0; v < kTileVectors; ++v) total[j][v] += x[v] * y;
      }
    }
    for (Index j = 0; j < kCount; ++j) {
      for (Index v = 0; v < kTileVectors; ++v) square[j] += total[j][v] * total[j][v];
    }
  }
  for (Index j = 0; j < kCount; ++j) out[j] = sum(square[j]);
}

void square_norms(Index n, const double* packed, Index count, const double* k, double* out) {
  if (count == 1) {
    square_norms_of<1>(n, packed, k, out);
  } else {
    square_norms_of<kTargetBlock>(n, packed, k, out);
  }
}

}  // namespace

const Numerics& TRAMMEL_NUMERICS_BUILD() {
  static const Numerics build = {
      TRAMMEL_NUMERICS_NAME, kTileRows,       work_size,           sweep,         inverse_root,    multiply_work_size,
      multiply_transposed,   packed_size,     pack_lower,          pack_triangle, unpack_triangle, square_norms,
      radial_tile,           radial_gradient, radial_weighted_sum, weight_column};
  return build;
}

}  // namespace trammel
