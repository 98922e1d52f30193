#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/bias/outputs/bias_outputs.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeastVariance =
    1e-18;  // m²: 1 nm; keeps the logarithm of an output that is zero finite

/// Predicts zero; the residual counts as noise.
class SilentOutputs final : public BiasOutputs {
 public:
  explicit SilentOutputs(const MatrixXd& residual)
      : points_(residual.rows()),
        variance_(residual.colwise().squaredNorm().transpose() /
                  static_cast<double>(residual.rows())) {}

  MatrixXd mean(const MatrixXd& q, const std::vector<BiasFeatures>& /*features*/) const override {
    return MatrixXd::Zero(q.rows(), variance_.size());
  }
  std::vector<OutputPrediction> predict(
      const MatrixXd& q, const std::vector<BiasFeatures>& /*features*/) const override {
    const MatrixXd covariance = variance_.asDiagonal();
    return {static_cast<std::size_t>(q.rows()),
            {VectorXd::Zero(variance_.size()), covariance, 1.0}};
  }
  VectorXd noise_variance() const override { return VectorXd::Zero(variance_.size()); }
  VectorXd log_likelihood() const override {
    const Eigen::ArrayXd at_least = variance_.array().max(kLeastVariance);
    return -0.5 * static_cast<double>(points_) *
           (variance_.array() / at_least + (2.0 * std::numbers::pi * at_least).log());
  }
  MatrixXd leave_one_out_mean() const override { return MatrixXd::Zero(points_, variance_.size()); }
  MatrixXd leave_one_out_variance() const override {
    return variance_.transpose().replicate(points_, 1);
  }
  VectorXd leave_one_out_share() const override { return VectorXd::Ones(points_); }

 private:
  Index points_;
  VectorXd variance_;
};

}  // namespace

BiasOutputsPtr make_silent_outputs(const MatrixXd& residual) {
  return std::make_shared<SilentOutputs>(residual);
}

}  // namespace trammel
