#include "server/numerics/product.h"

#include <algorithm>

#include "server/base/check.h"
#include "server/numerics/aligned_matrix.h"
#include "server/numerics/numerics.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index kPanel = 32;  // columns of a triangle that are computed together, including the
                              // entries outside the triangle

}  // namespace

MatrixXd transposed_product(const MatrixXd& a, const MatrixXd& b) {
  TRAMMEL_CHECK(a.rows() == b.rows());
  MatrixXd c(a.cols(), b.cols());
  numerics().transposed_product(a.rows(), a.cols(), a.data(), a.rows(), b.cols(), b.data(),
                                b.rows(), c.data(), c.rows());
  return c;
}

MatrixXd gram(const MatrixXd& a) {
  const Index n = a.cols();
  MatrixXd c(n, n);
  for (Index j = 0; j < n; j += kPanel) {
    const double* from = a.data() + j * a.rows();
    numerics().transposed_product(a.rows(), n - j, from, a.rows(), std::min(kPanel, n - j), from,
                                  a.rows(), c.data() + j + j * n, n);
  }
  c.triangularView<Eigen::StrictlyUpper>() = c.transpose();
  return c;
}

MatrixXd times_lower_transposed(const MatrixXd& a, const MatrixXd& l) {
  TRAMMEL_CHECK(a.cols() == l.rows() && l.rows() == l.cols());
  const Index n = l.rows();
  const MatrixXd left = a.transpose();
  const MatrixXd right = l.triangularView<Eigen::Lower>().transpose();
  MatrixXd c(a.rows(), n);
  for (Index j = 0; j < n; j += kPanel) {
    const Index width = std::min(kPanel, n - j);
    numerics().transposed_product(j + width, a.rows(), left.data(), n, width, right.data() + j * n,
                                  n, c.data() + j * c.rows(), c.rows());
  }
  return c;
}

std::optional<MatrixXd> inverse_factor(const MatrixXd& m) {
  TRAMMEL_CHECK(m.rows() == m.cols());
  const Index n = m.rows();
  if (n == 0) return MatrixXd(0, 0);
  AlignedMatrix storage = factor_storage(n);
  auto matrix = storage.map();
  matrix.topLeftCorner(n, n).triangularView<Eigen::Lower>() = m;
  AlignedMatrix work(numerics().work_size(n), 1);
  double log_det = 0;
  if (!numerics().inverse_root(n, 0, storage.data(), storage.rows(), work.data(), &log_det))
    return std::nullopt;
  MatrixXd inverse = MatrixXd::Zero(n, n);
  inverse.triangularView<Eigen::Lower>() = matrix.topLeftCorner(n, n);
  return inverse;
}

}  // namespace trammel
