#pragma once

#include "server/numerics/builds/vectors.h"

/// Matrices in single precision, packed so that a product with a vector of doubles reads them once, from front to back.
namespace trammel {
namespace {

typedef float Half __attribute__((vector_size(kLanes * sizeof(float)), aligned(4), may_alias));

inline Vec load_floats(const float* p) { return __builtin_convertvector(*reinterpret_cast<const Half*>(p), Vec); }

Index panel_size(Index rows, Index cols) { return round_up(rows, kTileRows) * cols; }

void pack_panels(Index rows, Index cols, const double* a, Index ld, float* packed) {
  for (Index i = 0; i < rows; i += kTileRows) {
    for (Index k = 0; k < cols; ++k) {
      for (Index r = 0; r < kTileRows; ++r) *packed++ = i + r < rows ? static_cast<float>(a[i + r + k * ld]) : 0.0F;
    }
  }
}

// Two columns at a time: sums that do not wait for each other.
void panel_product(Index rows, Index cols, const float* packed, const double* k, double* out) {
  for (Index i = 0; i < rows; i += kTileRows) {
    Vec even[kTileVectors] = {};
    Vec odd[kTileVectors] = {};
    Index m = 0;
    for (; m + 1 < cols; m += 2, packed += 2 * kTileRows) {
      const Vec x = broadcast(k[m]);
      const Vec y = broadcast(k[m + 1]);
#pragma GCC unroll 3
      for (Index v = 0; v < kTileVectors; ++v) {
        even[v] += load_floats(packed + v * kLanes) * x;
        odd[v] += load_floats(packed + kTileRows + v * kLanes) * y;
      }
    }
    for (; m < cols; ++m, packed += kTileRows) {
      for (Index v = 0; v < kTileVectors; ++v) even[v] += load_floats(packed + v * kLanes) * broadcast(k[m]);
    }
    for (Index v = 0; v < kTileVectors; ++v) store(out + i + v * kLanes, even[v] + odd[v]);
  }
}

}  // namespace
}  // namespace trammel
