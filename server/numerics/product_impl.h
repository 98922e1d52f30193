// Included once by each build behind its target pragma, with TRAMMEL_PRODUCT_LANES (doubles in a vector) and
// TRAMMEL_PRODUCT_NAME defined.

namespace trammel {

namespace {

typedef double Lanes __attribute__((vector_size(8 * TRAMMEL_PRODUCT_LANES), aligned(8)));

constexpr long kLanes = TRAMMEL_PRODUCT_LANES;
constexpr long kBlock = 4;     // columns of either side that are in registers together
constexpr long kStrip = 1024;  // rows at a time, so that eight columns stay in the first cache

inline double sum_of(const Lanes& lanes) {
  double sum = 0;
  for (long l = 0; l < kLanes; ++l) sum += lanes[l];
  return sum;
}

/// c += AᵀB for up to kBlock columns of each and `rows` rows.
template <long M, long N>
inline void block(long rows, const double* a, long lda, const double* b, long ldb, double* c, long ldc) {
  Lanes sums[M][N] = {};
  long r = 0;
  for (; r + kLanes <= rows; r += kLanes) {
    Lanes left[M];
    for (long i = 0; i < M; ++i) left[i] = *reinterpret_cast<const Lanes*>(a + i * lda + r);
    for (long j = 0; j < N; ++j) {
      const Lanes right = *reinterpret_cast<const Lanes*>(b + j * ldb + r);
      for (long i = 0; i < M; ++i) sums[i][j] += left[i] * right;
    }
  }
  for (long j = 0; j < N; ++j) {
    for (long i = 0; i < M; ++i) {
      double sum = sum_of(sums[i][j]);
      for (long rest = r; rest < rows; ++rest) sum += a[i * lda + rest] * b[j * ldb + rest];
      c[i + j * ldc] += sum;
    }
  }
}

template <long M>
inline void row_of_blocks(long rows, const double* a, long lda, long n, const double* b, long ldb, double* c,
                          long ldc) {
  long j = 0;
  for (; j + kBlock <= n; j += kBlock) block<M, kBlock>(rows, a, lda, b + j * ldb, ldb, c + j * ldc, ldc);
  for (; j < n; ++j) block<M, 1>(rows, a, lda, b + j * ldb, ldb, c + j * ldc, ldc);
}

}  // namespace

void TRAMMEL_PRODUCT_NAME(long k, long m, const double* a, long lda, long n, const double* b, long ldb, double* c,
                          long ldc) {
  for (long j = 0; j < n; ++j) {
    for (long i = 0; i < m; ++i) c[i + j * ldc] = 0;
  }
  for (long first = 0; first < k; first += kStrip) {
    const long rows = k - first < kStrip ? k - first : kStrip;
    long i = 0;
    for (; i + kBlock <= m; i += kBlock)
      row_of_blocks<kBlock>(rows, a + i * lda + first, lda, n, b + first, ldb, c + i, ldc);
    for (; i < m; ++i) row_of_blocks<1>(rows, a + i * lda + first, lda, n, b + first, ldb, c + i, ldc);
  }
}

}  // namespace trammel
