#pragma once

#include <Eigen/Dense>

namespace trammel {

/// AᵀB (m x n of k x m and k x n). What a scan spends its time on: built for each instruction set and chosen when the
/// program runs. The same on every run of one machine.
[[nodiscard]] Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// On raw column-major arrays: c(i, j) = Σ_r a(r, i) b(r, j). Each build is a translation unit of its own that uses
/// neither Eigen nor a standard template, since their inline functions would be merged across builds.
using RawProduct = void (*)(std::ptrdiff_t k, std::ptrdiff_t m, const double* a, std::ptrdiff_t lda, std::ptrdiff_t n,
                            const double* b, std::ptrdiff_t ldb, double* c, std::ptrdiff_t ldc);
void raw_product_baseline(std::ptrdiff_t k, std::ptrdiff_t m, const double* a, std::ptrdiff_t lda, std::ptrdiff_t n,
                          const double* b, std::ptrdiff_t ldb, double* c, std::ptrdiff_t ldc);
void raw_product_avx2(std::ptrdiff_t k, std::ptrdiff_t m, const double* a, std::ptrdiff_t lda, std::ptrdiff_t n,
                      const double* b, std::ptrdiff_t ldb, double* c, std::ptrdiff_t ldc);
void raw_product_avx512(std::ptrdiff_t k, std::ptrdiff_t m, const double* a, std::ptrdiff_t lda, std::ptrdiff_t n,
                        const double* b, std::ptrdiff_t ldb, double* c, std::ptrdiff_t ldc);

}  // namespace trammel
