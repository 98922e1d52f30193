#pragma once

#include "server/numerics/builds/vectors.h"

/// Lower triangles packed so that a product with a vector reads them once, from front to back.
namespace trammel {
namespace {

Index packed_size(Index n) {
  Index total = 0;
  for (Index i = 0; i < n; i += kTileRows) total += kTileRows * least(n, i + kTileRows);
  return total;
}

void pack_lower(Index n, Index first, const double* a, Index ld, double* packed) {
  for (Index k = 0; k < least(n, first + kTileRows); ++k, packed += kTileRows) {
    for (Index r = 0; r < kTileRows; ++r)
      packed[r] = first + r < n && first + r >= k ? a[first + r + k * ld] : 0.0;
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

template <Index kCount, typename Number>
void square_norms_of(Index n, const Number* packed, const double* k, double* out) {
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

template <typename Number>
void square_norms(Index n, const Number* packed, Index count, const double* k, double* out) {
  if (count == 1) {
    square_norms_of<1>(n, packed, k, out);
  } else {
    square_norms_of<kTargetBlock>(n, packed, k, out);
  }
}

}  // namespace
}  // namespace trammel
