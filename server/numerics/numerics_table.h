#pragma once

#include <cstddef>

/// The functions of one build: the inner loops of learning and of diagnosis, on raw column-major
/// arrays.
///
/// Each instruction set has a build of its own: one source file in `builds/` that includes the
/// loops behind a target pragma. No build may use Eigen or a standard template, because their
/// inline functions have external linkage. The linker would keep one copy for the whole program,
/// perhaps the AVX-512 one, and the program would die on an older processor. Raw pointers and an
/// unnamed namespace prevent that.
namespace trammel {

/// Covariance as a function of h = r²/2, r the scaled distance.
enum class RadialShape { kSquaredExponential, kMatern32, kMatern52 };

/// Rows of feature tables and of matrices are padded to this many; the padding must be allocated
/// and finite.
constexpr std::ptrdiff_t kRowPadding = 24;
constexpr std::ptrdiff_t padded_rows(std::ptrdiff_t n) {
  return (n + kRowPadding - 1) / kRowPadding * kRowPadding;
}
/// Columns of right-hand sides that `square_norms` takes at once.
constexpr std::ptrdiff_t kTargetBlock = 8;

/// One build. Sizes in doubles; `ld`: leading dimension, doubles from one column to the next.
struct Numerics {
  const char* name;
  std::ptrdiff_t packed_rows;  ///< rows that the packed form holds together

  /// Doubles of scratch that `sweep` and `inverse_root` need for `rows` = n + extra.
  std::ptrdiff_t (*work_size)(std::ptrdiff_t rows);

  /// In: the lower triangle of [M Yᵀ; Y 0], M n x n positive definite, Y extra x n; `ld` >=
  /// padded_rows(n + extra), as many columns, padding zero. Out: the lower triangle of [-M⁻¹ .; Y
  /// M⁻¹ -Y M⁻¹ Yᵀ] and log det M. The upper triangle is scratch. False when M is not positive
  /// definite. n³ flops.
  bool (*sweep)(std::ptrdiff_t n, std::ptrdiff_t extra, double* a, std::ptrdiff_t ld, double* work,
                double* log_det);

  /// In: as of sweep(). Out: L⁻¹ of M = L Lᵀ in the lower triangle, -Y M⁻¹ in the extra rows. 2/3
  /// n³ flops.
  bool (*inverse_root)(std::ptrdiff_t n, std::ptrdiff_t extra, double* a, std::ptrdiff_t ld,
                       double* work, double* log_det);

  /// Doubles of scratch that `multiply_transposed` needs.
  std::ptrdiff_t (*multiply_work_size)(std::ptrdiff_t rows, std::ptrdiff_t cols);
  /// c += sign a bᵀ; a is rows x depth, b cols x depth, c rows x cols, all with padded_rows() rows,
  /// c with as many columns. `lower_only` leaves out tiles above the diagonal of c.
  void (*multiply_transposed)(std::ptrdiff_t rows, std::ptrdiff_t cols, std::ptrdiff_t depth,
                              double sign, const double* a, std::ptrdiff_t lda, const double* b,
                              std::ptrdiff_t ldb, bool lower_only, double* c, std::ptrdiff_t ldc,
                              double* work);

  /// c(i, j) = Σ_r a(r, i) b(r, j): c = AᵀB, a k x m, b k x n, c m x n. Needs no padding.
  void (*transposed_product)(std::ptrdiff_t k, std::ptrdiff_t m, const double* a,
                             std::ptrdiff_t lda, std::ptrdiff_t n, const double* b,
                             std::ptrdiff_t ldb, double* c, std::ptrdiff_t ldc);

  /// Length of the packed form of a lower triangle of n rows.
  std::ptrdiff_t (*packed_size)(std::ptrdiff_t n);
  /// Packs `packed_rows` rows from `first`, a multiple of `packed_rows`; their place begins at
  /// packed_size(first).
  void (*pack_lower)(std::ptrdiff_t n, std::ptrdiff_t first, const double* a, std::ptrdiff_t ld,
                     double* packed);
  /// From and to a triangle stored row after row, n (n + 1) / 2 doubles.
  void (*pack_triangle)(std::ptrdiff_t n, const double* triangle, double* packed);
  void (*unpack_triangle)(std::ptrdiff_t n, const double* packed, double* triangle);
  /// out[j] = |W k_j|² for the packed lower triangle W; `k` is kTargetBlock columns interleaved
  /// (k[i * kTargetBlock + j]) when count > 1, one plain column when count == 1.
  void (*square_norms)(std::ptrdiff_t n, const double* packed, std::ptrdiff_t count,
                       const double* k, double* out);

  /// square_norms() of a packed triangle that was rounded to single precision, number by number;
  /// sums are in double.
  void (*square_norms_single)(std::ptrdiff_t n, const float* packed, std::ptrdiff_t count,
                              const double* k, double* out);

  /// k(i, j) of feature tables a (rows x dims + 1, ld `lda`) and b (cols x dims + 1); the last
  /// feature is |z|²/2. Writes whole vectors: up to padded_rows(rows) of each column.
  void (*radial_tile)(RadialShape shape, std::ptrdiff_t dims, std::ptrdiff_t rows, const double* a,
                      std::ptrdiff_t lda, std::ptrdiff_t cols, const double* b, std::ptrdiff_t ldb,
                      double* k, std::ptrdiff_t ldk);
  /// gradient[d] += Σ_ij g_ij dk_ij/dlog l_d; g has zeros in the row padding.
  void (*radial_gradient)(RadialShape shape, std::ptrdiff_t dims, std::ptrdiff_t rows,
                          const double* a, std::ptrdiff_t lda, std::ptrdiff_t cols, const double* b,
                          std::ptrdiff_t ldb, const double* g, std::ptrdiff_t ldg,
                          double* gradient);
  /// out[j] = Σ_i weights_i k(a_i, b_j); `weights` has zeros in the row padding.
  void (*radial_weighted_sum)(RadialShape shape, std::ptrdiff_t dims, std::ptrdiff_t rows,
                              const double* a, std::ptrdiff_t lda, std::ptrdiff_t cols,
                              const double* b, std::ptrdiff_t ldb, const double* weights,
                              double* out);

  /// g_i = scale * a_i - Σ_d c_d alpha_id, i < rows; alpha is rows x outputs.
  void (*weight_column)(std::ptrdiff_t rows, double scale, const double* a, std::ptrdiff_t outputs,
                        const double* alpha, std::ptrdiff_t ld_alpha, const double* c, double* g);
};

}  // namespace trammel
