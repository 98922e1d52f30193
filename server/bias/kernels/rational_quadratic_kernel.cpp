#include "server/bias/kernels/kernel_tiles.h"

namespace trammel {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::VectorXd;

// r²/2 of all rows of `z` and row j of `other`.
ArrayXd half_square_distance(const StridedColumns& z, const StridedColumns& other, Index j) {
  ArrayXd h = ArrayXd::Zero(z.rows());
  for (Index d = 0; d < z.cols(); ++d) h += 0.5 * (z.col(d).array() - other(j, d)).square();
  return h;
}

class RationalQuadraticKernel : public Kernel {
 public:
  std::string_view name() const override { return "rational_quadratic"; }
  Index parameter_count(Index joints) const override { return joints + 1; }
  Index feature_count(Index joints) const override { return joints; }

  SearchBox search_box(const Eigen::MatrixXd& q) const override {
    SearchBox box = length_scale_box(q);
    box.low.conservativeResize(q.cols() + 1);
    box.high.conservativeResize(q.cols() + 1);
    box.low[q.cols()] = std::log(0.3);
    box.high[q.cols()] = std::log(10.0);
    return box;
  }

  void features(const VectorXd& parameters, const Eigen::MatrixXd& q, double* table,
                Index ld) const override {
    scaled_joints(parameters.head(q.cols()), q, table, ld);
  }

  void diagonal(const VectorXd& /*parameters*/, const FeatureBlock& a, double* k) const override {
    std::fill_n(k, a.rows, 1.0);
  }

  void tile(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b, double* k,
            Index ldk) const override {
    const Index joints = parameters.size() - 1;
    const double alpha = std::exp(parameters[joints]);
    auto out = columns_of(k, a.rows, b.rows, ldk).array();
    for (Index j = 0; j < b.rows; ++j) {
      const ArrayXd h = half_square_distance(columns_of(a, joints), columns_of(b, joints), j);
      out.col(j) = (-alpha * (h / alpha).log1p()).exp();
    }
  }

  // With u = 1 + h/α: dk/dlog l = u^(-α-1) Δz², dk/dlog α = k α (1 - 1/u - log u).
  void tile_gradient(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                     const double* g, Index ldg, double* gradient) const override {
    const Index joints = parameters.size() - 1;
    const double alpha = std::exp(parameters[joints]);
    const auto z = columns_of(a, joints);
    const auto other = columns_of(b, joints);
    const auto weight = columns_of(g, a.rows, b.rows, ldg).array();
    for (Index j = 0; j < b.rows; ++j) {
      const ArrayXd excess = half_square_distance(z, other, j) / alpha;  // u - 1
      const ArrayXd log_u = excess.log1p();
      const ArrayXd weighted = weight.col(j) * (-alpha * log_u).exp();
      const ArrayXd slope = weighted / (1.0 + excess);
      for (Index d = 0; d < joints; ++d)
        gradient[d] += (slope * (z.col(d).array() - other(j, d)).square()).sum();
      gradient[joints] += alpha * (slope * excess - weighted * log_u).sum();
    }
  }

  void weighted_sum(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    const double* weights, double* out) const override {
    weighted_sum_by_tiles(*this, parameters, a, b, weights, out);
  }
};

}  // namespace

KernelPtr make_rational_quadratic_kernel() { return std::make_shared<RationalQuadraticKernel>(); }

}  // namespace trammel
