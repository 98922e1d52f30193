#include "server/bias/kernels/kernel_tiles.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

class LinearKernel : public Kernel {
 public:
  std::string_view name() const override { return "linear"; }
  Index parameter_count(Index joints) const override { return joints; }
  Index feature_count(Index joints) const override { return joints; }
  SearchBox search_box(const Eigen::MatrixXd& q) const override { return length_scale_box(q); }

  void features(const VectorXd& parameters, const Eigen::MatrixXd& q, double* table,
                Index ld) const override {
    scaled_joints(parameters, q, table, ld);
  }

  void diagonal(const VectorXd& parameters, const FeatureBlock& a, double* k) const override {
    const auto z = columns_of(a, parameters.size());
    for (Index i = 0; i < a.rows; ++i) k[i] = 1.0 + z.row(i).squaredNorm();
  }

  void tile(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b, double* k,
            Index ldk) const override {
    const auto z = columns_of(a, parameters.size());
    const auto other = columns_of(b, parameters.size());
    auto out = columns_of(k, a.rows, b.rows, ldk);
    out.setOnes();
    for (Index j = 0; j < b.rows; ++j) {
      for (Index d = 0; d < z.cols(); ++d) out.col(j) += z.col(d) * other(j, d);
    }
  }

  void tile_gradient(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                     const double* g, Index ldg, double* gradient) const override {
    const auto z = columns_of(a, parameters.size());
    const auto other = columns_of(b, parameters.size());
    const auto weight = columns_of(g, a.rows, b.rows, ldg);
    for (Index j = 0; j < b.rows; ++j) {
      for (Index d = 0; d < z.cols(); ++d)
        gradient[d] -= 2.0 * other(j, d) * z.col(d).dot(weight.col(j));
    }
  }

  // Σ w (1 + z·z') = Σ w + (Σ w z)·z'.
  void weighted_sum(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    const double* weights, double* out) const override {
    const auto z = columns_of(a, parameters.size());
    const auto other = columns_of(b, parameters.size());
    const Eigen::Map<const VectorXd> w(weights, a.rows);
    Eigen::Map<VectorXd> sum(out, b.rows);
    sum.setConstant(w.sum());
    for (Index d = 0; d < z.cols(); ++d) sum += other.col(d) * z.col(d).dot(w);
  }
};

}  // namespace

KernelPtr make_linear_kernel() { return std::make_shared<LinearKernel>(); }

}  // namespace trammel
