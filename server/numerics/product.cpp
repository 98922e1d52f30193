#include "server/numerics/product.h"

#include "server/base/check.h"

namespace trammel {

namespace {

RawProduct fastest() {
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) return raw_product_avx512;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return raw_product_avx2;
  return raw_product_baseline;
}

}  // namespace

Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  TRAMMEL_CHECK(a.rows() == b.rows());
  static const RawProduct product = fastest();
  Eigen::MatrixXd c(a.cols(), b.cols());
  product(a.rows(), a.cols(), a.data(), a.rows(), b.cols(), b.data(), b.rows(), c.data(), c.rows());
  return c;
}

}  // namespace trammel
