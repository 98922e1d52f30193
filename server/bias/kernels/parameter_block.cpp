#include "server/bias/kernels/linear_block.h"

namespace trammel {
namespace {

class ParameterBlock final : public LinearBlock {
 public:
  std::string_view name() const override { return "parameters"; }
  Eigen::Index column_count(const BiasFeatures& shape) const override {
    return shape.by_parameter.cols();
  }
  Eigen::Index parameter_count(const BiasFeatures& /*shape*/) const override { return 0; }
  Eigen::VectorXd start(const BiasFeatures& /*shape*/) const override { return {}; }
  Eigen::VectorXd spread(const BiasFeatures& /*shape*/) const override { return {}; }
  void columns(const JointVector& /*q*/, const BiasFeatures& features,
               Eigen::Ref<Eigen::MatrixXd> out) const override {
    out = features.by_parameter;
  }
  void log_variance(const BiasFeatures& /*shape*/, const Eigen::VectorXd& /*parameters*/,
                    Eigen::Ref<Eigen::VectorXd> log_variance,
                    Eigen::Ref<Eigen::MatrixXd> /*derivative*/) const override {
    log_variance.setZero();
  }
};

}  // namespace

LinearBlockPtr make_parameter_block() { return std::make_shared<ParameterBlock>(); }

}  // namespace trammel
