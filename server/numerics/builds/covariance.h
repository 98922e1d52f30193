#pragma once

#include "server/numerics/builds/vectors.h"

/// Tiles, sums and slopes of covariances that depend on a scaled distance alone.
namespace trammel {
namespace {

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

// r²/2 = |z|²/2 + |z'|²/2 - z·z' for kCount vectors of rows at once; rounding may make it a little
// negative.
constexpr Index kUnroll = 4;

template <Index kCount>
[[gnu::always_inline]] inline void half_square_distance(Index dims, const double* a, Index lda,
                                                        const double* b, Index ldb, Vec* h) {
  const Vec half_b = broadcast(b[dims * ldb]);
  for (Index u = 0; u < kCount; ++u) h[u] = load(a + dims * lda + u * kLanes) + half_b;
  for (Index d = 0; d < dims; ++d) {
    const Vec z = broadcast(b[d * ldb]);
    for (Index u = 0; u < kCount; ++u) h[u] -= load(a + d * lda + u * kLanes) * z;
  }
}

template <typename Shape, Index kCount>
inline void tile_rows(Index dims, const double* a, Index lda, const double* b, Index ldb,
                      double* k) {
  Vec h[kCount];
  half_square_distance<kCount>(dims, a, lda, b, ldb, h);
  for (Index u = 0; u < kCount; ++u) store(k + u * kLanes, Shape::value(h[u]));
}

template <typename Shape>
void tile(Index dims, Index rows, const double* a, Index lda, Index cols, const double* b,
          Index ldb, double* k, Index ldk) {
  const Index end = round_up(rows, kLanes);
  for (Index j = 0; j < cols; ++j) {
    Index i = 0;
    for (; i + kUnroll * kLanes <= end; i += kUnroll * kLanes)
      tile_rows<Shape, kUnroll>(dims, a + i, lda, b + j, ldb, k + i + j * ldk);
    for (; i < end; i += kLanes) tile_rows<Shape, 1>(dims, a + i, lda, b + j, ldb, k + i + j * ldk);
  }
}

template <typename Shape, Index kCount>
[[gnu::always_inline]] inline Vec weighted_rows(Index dims, const double* a, Index lda,
                                                const double* b, Index ldb, const double* weights) {
  Vec h[kCount];
  half_square_distance<kCount>(dims, a, lda, b, ldb, h);
  Vec total = {};
  for (Index u = 0; u < kCount; ++u) total += load(weights + u * kLanes) * Shape::value(h[u]);
  return total;
}

// Rows in chunks that stay in the first-level cache while every column passes over them.
template <typename Shape>
[[gnu::always_inline]] inline void weighted_sum_of(Index dims, Index rows, const double* a,
                                                   Index lda, Index cols, const double* b,
                                                   Index ldb, const double* weights, double* out) {
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
      for (; i < stop; i += kLanes)
        total += weighted_rows<Shape, 1>(dims, a + i, lda, b + j, ldb, weights + i);
      out[j] += sum(total);
    }
  }
}

// The loop over six joints is unrolled.
template <typename Shape>
void weighted_sum(Index dims, Index rows, const double* a, Index lda, Index cols, const double* b,
                  Index ldb, const double* weights, double* out) {
  if (dims == 6) return weighted_sum_of<Shape>(6, rows, a, lda, cols, b, ldb, weights, out);
  weighted_sum_of<Shape>(dims, rows, a, lda, cols, b, ldb, weights, out);
}

// With the number of joints known at compile time (kDims > 0) the squared differences and the
// totals stay in registers.
template <typename Shape, Index kDims>
void gradient_fixed(Index rows, const double* a, Index lda, Index cols, const double* b, Index ldb,
                    const double* g, Index ldg, double* gradient) {
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
void gradient_any(Index dims, Index rows, const double* a, Index lda, Index cols, const double* b,
                  Index ldb, const double* g, Index ldg, double* gradient) {
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
void gradient_tile(Index dims, Index rows, const double* a, Index lda, Index cols, const double* b,
                   Index ldb, const double* g, Index ldg, double* gradient) {
  switch (dims) {
    case 6:
      return gradient_fixed<Shape, 6>(rows, a, lda, cols, b, ldb, g, ldg, gradient);
    case 7:
      return gradient_fixed<Shape, 7>(rows, a, lda, cols, b, ldb, g, ldg, gradient);
    default:
      return gradient_any<Shape>(dims, rows, a, lda, cols, b, ldb, g, ldg, gradient);
  }
}

void radial_tile(RadialShape shape, Index dims, Index rows, const double* a, Index lda, Index cols,
                 const double* b, Index ldb, double* k, Index ldk) {
  switch (shape) {
    case RadialShape::kSquaredExponential:
      return tile<SquaredExponential>(dims, rows, a, lda, cols, b, ldb, k, ldk);
    case RadialShape::kMatern32:
      return tile<Matern32>(dims, rows, a, lda, cols, b, ldb, k, ldk);
    case RadialShape::kMatern52:
      return tile<Matern52>(dims, rows, a, lda, cols, b, ldb, k, ldk);
  }
}

void radial_gradient(RadialShape shape, Index dims, Index rows, const double* a, Index lda,
                     Index cols, const double* b, Index ldb, const double* g, Index ldg,
                     double* gradient) {
  switch (shape) {
    case RadialShape::kSquaredExponential:
      return gradient_tile<SquaredExponential>(dims, rows, a, lda, cols, b, ldb, g, ldg, gradient);
    case RadialShape::kMatern32:
      return gradient_tile<Matern32>(dims, rows, a, lda, cols, b, ldb, g, ldg, gradient);
    case RadialShape::kMatern52:
      return gradient_tile<Matern52>(dims, rows, a, lda, cols, b, ldb, g, ldg, gradient);
  }
}

void radial_weighted_sum(RadialShape shape, Index dims, Index rows, const double* a, Index lda,
                         Index cols, const double* b, Index ldb, const double* weights,
                         double* out) {
  switch (shape) {
    case RadialShape::kSquaredExponential:
      return weighted_sum<SquaredExponential>(dims, rows, a, lda, cols, b, ldb, weights, out);
    case RadialShape::kMatern32:
      return weighted_sum<Matern32>(dims, rows, a, lda, cols, b, ldb, weights, out);
    case RadialShape::kMatern52:
      return weighted_sum<Matern52>(dims, rows, a, lda, cols, b, ldb, weights, out);
  }
}

void weight_column(Index rows, double scale, const double* a, Index outputs, const double* alpha,
                   Index ld_alpha, const double* c, double* g) {
  for (Index i = 0; i < rows; ++i) g[i] = scale * a[i];
  for (Index d = 0; d < outputs; ++d)
    for (Index i = 0; i < rows; ++i) g[i] -= c[d] * alpha[i + d * ld_alpha];
}

}  // namespace
}  // namespace trammel
