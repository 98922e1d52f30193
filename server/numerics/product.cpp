#include "server/numerics/product.h"

#include "server/base/check.h"
#include "server/numerics/numerics.h"

namespace trammel {

Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  TRAMMEL_CHECK(a.rows() == b.rows());
  Eigen::MatrixXd c(a.cols(), b.cols());
  numerics().transposed_product(a.rows(), a.cols(), a.data(), a.rows(), b.cols(), b.data(), b.rows(), c.data(),
                                c.rows());
  return c;
}

}  // namespace trammel
