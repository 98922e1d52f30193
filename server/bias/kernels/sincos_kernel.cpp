#include <utility>

#include "server/bias/kernels/kernel_tiles.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd sincos(const MatrixXd& q) {
  MatrixXd both(q.rows(), 2 * q.cols());
  both << q.array().cos().matrix(), q.array().sin().matrix();
  return both;
}

class SincosKernel : public Kernel {
 public:
  explicit SincosKernel(KernelPtr inner)
      : inner_(std::move(inner)), name_(std::string(inner_->name()) + "(sincos)") {}

  std::string_view name() const override { return name_; }
  Index parameter_count(Index joints) const override { return inner_->parameter_count(joints); }
  Index feature_count(Index joints) const override { return inner_->feature_count(2 * joints); }

  // The larger spread of a joint's cosine and sine decides.
  SearchBox search_box(const MatrixXd& q) const override {
    const SearchBox both = inner_->search_box(sincos(q));
    SearchBox box{VectorXd::Constant(parameter_count(q.cols()), -HUGE_VAL),
                  VectorXd::Constant(parameter_count(q.cols()), -HUGE_VAL)};
    for (Index p = 0; p < both.low.size(); ++p) {
      const Index own = own_parameter(p, q.cols());
      box.low[own] = std::max(box.low[own], both.low[p]);
      box.high[own] = std::max(box.high[own], both.high[p]);
    }
    return box;
  }

  void features(const VectorXd& parameters, const MatrixXd& q, double* table,
                Index ld) const override {
    inner_->features(of_both(parameters), sincos(q), table, ld);
  }

  void diagonal(const VectorXd& parameters, const FeatureBlock& a, double* k) const override {
    inner_->diagonal(of_both(parameters), a, k);
  }

  void tile(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b, double* k,
            Index ldk) const override {
    inner_->tile(of_both(parameters), a, b, k, ldk);
  }

  void tile_gradient(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                     const double* g, Index ldg, double* gradient) const override {
    const Index joints = joints_of(*this, parameters.size());
    const VectorXd expanded = of_both(parameters);
    VectorXd both = VectorXd::Zero(expanded.size());
    inner_->tile_gradient(expanded, a, b, g, ldg, both.data());
    for (Index p = 0; p < both.size(); ++p) gradient[own_parameter(p, joints)] += both[p];
  }

  void weighted_sum(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    const double* weights, double* out) const override {
    inner_->weighted_sum(of_both(parameters), a, b, weights, out);
  }

 private:
  // The inner kernel has twice as many joints; its parameter `p` is this one of ours.
  Index own_parameter(Index p, Index joints) const {
    const Index of_joints = (inner_->parameter_count(1) - inner_->parameter_count(0)) * joints;
    return p < 2 * of_joints ? p / (2 * joints) * joints + p % joints : p - of_joints;
  }

  VectorXd of_both(const VectorXd& parameters) const {
    const Index joints = joints_of(*this, parameters.size());
    VectorXd both(inner_->parameter_count(2 * joints));
    for (Index p = 0; p < both.size(); ++p) both[p] = parameters[own_parameter(p, joints)];
    return both;
  }

  KernelPtr inner_;
  std::string name_;
};

}  // namespace

KernelPtr make_sincos_kernel(KernelPtr inner) {
  return std::make_shared<SincosKernel>(std::move(inner));
}

}  // namespace trammel
