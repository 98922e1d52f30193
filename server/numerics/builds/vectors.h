#pragma once

/// One vector of doubles: load, store, square root and exponential.
///
/// Every header of this folder is compiled once for each build, behind the build's target pragma
/// and with TRAMMEL_VECTOR_LANES (doubles in a vector) and TRAMMEL_TILE_COLUMNS defined. See
/// numerics_table.h for why nothing here may have external linkage.
namespace trammel {
namespace {

using Index = ptrdiff_t;

constexpr Index kLanes = TRAMMEL_VECTOR_LANES;
constexpr Index kTileVectors = 3;                   // micro-tile rows, in vectors
constexpr Index kTileRows = kTileVectors * kLanes;  // 24, 12, 6: all divide kRowPadding
constexpr Index kTileColumns =
    TRAMMEL_TILE_COLUMNS;  // 8, 4, 4: accumulators fill the register file
constexpr Index kMaxBlock = 96;

typedef double Vec __attribute__((vector_size(kLanes * sizeof(double))));
typedef double Loose __attribute__((vector_size(kLanes * sizeof(double)), aligned(8), may_alias));
typedef long long Bits __attribute__((vector_size(kLanes * sizeof(double))));

typedef float Single __attribute__((vector_size(kLanes * sizeof(float)), aligned(4), may_alias));

inline Vec load(const double* p) { return *reinterpret_cast<const Loose*>(p); }
inline Vec load(const float* p) {
  return __builtin_convertvector(*reinterpret_cast<const Single*>(p), Vec);
}
inline void store(double* p, Vec v) { *reinterpret_cast<Loose*>(p) = v; }
inline Vec broadcast(double x) { return Vec{} + x; }
// Masked: the plain AVX-512 intrinsics make GCC 12 warn of an operand that they leave undefined.
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

// e^x for x <= 0, 1e-15 + |x| 1e-16 relative; below -708 it stays at e^-708, which is 0 for any sum
// here. x = n/8 ln 2 + r, |r| <= ln 2 / 16. 2^(n/8) is one permutation of eight doubles and an
// integer addition; e^r is a Chebyshev polynomial of degree 6. Adding 1.5 * 2^52 leaves n in the
// low bits of the mantissa; the table has n mod 8 taken off where n << 49 puts it.
inline Vec exp_of_negative(Vec x) {
  constexpr Bits kPowers = {0x3ff0000000000000, 0x3fef72b83c7d517b, 0x3fef06fe0a31b715,
                            0x3feebfdad5362a27, 0x3feea09e667f3bcd, 0x3feeace5422aa0db,
                            0x3feee89f995ad3ad, 0x3fef5818dcfba487};
  constexpr double kShift = 0x1.8p52;
  x = largest(x, broadcast(-708.0));
  const Vec shifted = x * 0x1.71547652b82fep+3 + kShift;
  const Vec r = x - (shifted - kShift) * 0x1.62e42fefa39efp-4;
  const Bits n = reinterpret_cast<Bits>(shifted);
#ifdef __clang__
  const Bits powers = reinterpret_cast<Bits>(
      _mm512_permutexvar_epi64(reinterpret_cast<__m512i>(n), reinterpret_cast<__m512i>(kPowers)));
#else
  const Bits powers = __builtin_shuffle(kPowers, n);
#endif
  const Vec power = reinterpret_cast<Vec>(powers + (n << 49));
  const Vec p = 0x1.0000000000000p+0 +
                r * (0x1.0000000000287p+0 +
                     r * (0x1.0000000000172p-1 +
                          r * (0x1.555555404e1f0p-3 +
                               r * (0x1.5555554650340p-5 +
                                    r * (0x1.111689121f9ffp-7 + r * 0x1.6c1d016b94860p-10)))));
  return p * power;
}

#else

// e^x for x <= 0, 4e-16 relative; below -708 it stays at e^-708, which is 0 for any sum here. x = n
// ln 2 + r, |r| <= ln 2 / 2, Chebyshev polynomial of degree 10 in r; adding 1.5 * 2^52 leaves n in
// the low bits of the mantissa.
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

}  // namespace
}  // namespace trammel
