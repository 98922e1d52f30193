#include <cmath>

#include "server/bias/kernels/linear_block.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kHarmonics = 48;  // with the knee at the sixth, the last has 1/4000 of the variance of the first
constexpr Index kColumnsOfJoint = 2 * kHarmonics + 1;
constexpr double kTypicalAmplitude = 1e-4;  // rad: 0.1 mm at 1 m, as gears have it
constexpr double kTypicalKnee = 6.0;        // harmonic: gear errors of an arm begin to fall off there
constexpr double kAmplitudeSpread = 2.0;    // in logs, one standard deviation: from a seventh to seven times as large
constexpr double kKneeSpread = 0.7;         // in logs: from half to twice the harmonic

/// 1 / (1 + (h/knee)²)²: the spectral density of a Matérn 3/2 process.
double density(Index harmonic, double knee) {
  return std::pow(1 + std::pow(static_cast<double>(harmonic) / knee, 2), -2);
}

/// Derivative of its logarithm by log knee.
double density_slope(Index harmonic, double knee) {
  const double ratio = std::pow(static_cast<double>(harmonic) / knee, 2);
  return 4 * ratio / (1 + ratio);
}

class JointMapBlock final : public LinearBlock {
 public:
  std::string_view name() const override { return "joint_map"; }
  Index column_count(const BiasFeatures& shape) const override { return kColumnsOfJoint * shape.by_joint.cols(); }
  Index parameter_count(const BiasFeatures& shape) const override { return 2 * shape.by_joint.cols(); }
  VectorXd start(const BiasFeatures& shape) const override {
    return Eigen::Vector2d(std::log(kTypicalAmplitude), std::log(kTypicalKnee)).replicate(shape.by_joint.cols(), 1);
  }
  VectorXd spread(const BiasFeatures& shape) const override {
    return Eigen::Vector2d(kAmplitudeSpread, kKneeSpread).replicate(shape.by_joint.cols(), 1);
  }

  // For each joint J_j, then J_j cos(h q_j) and J_j sin(h q_j). A harmonic is the one before, turned by q_j.
  void columns(const JointVector& q, const BiasFeatures& features, Eigen::Ref<MatrixXd> out) const override {
    for (Index j = 0; j < features.by_joint.cols(); ++j) {
      const Vector6 J = features.by_joint.col(j);
      const double cosine = std::cos(q[j]);
      const double sine = std::sin(q[j]);
      double c = 1;
      double s = 0;
      out.col(kColumnsOfJoint * j) = J;
      for (Index h = 1; h <= kHarmonics; ++h) {
        const double turned = c * cosine - s * sine;
        s = s * cosine + c * sine;
        c = turned;
        out.col(kColumnsOfJoint * j + 2 * h - 1) = c * J;
        out.col(kColumnsOfJoint * j + 2 * h) = s * J;
      }
    }
  }

  void log_variance(const BiasFeatures& shape, const VectorXd& parameters, Eigen::Ref<VectorXd> log_variance,
                    Eigen::Ref<MatrixXd> derivative) const override {
    for (Index j = 0; j < shape.by_joint.cols(); ++j) {
      const double knee = std::exp(parameters[2 * j + 1]);
      double total = 0;
      double slope = 0;
      for (Index h = 0; h <= kHarmonics; ++h) {
        total += density(h, knee);
        slope += density(h, knee) * density_slope(h, knee);
      }
      for (Index column = 0; column < kColumnsOfJoint; ++column) {
        const Index h = (column + 1) / 2;
        const Index row = kColumnsOfJoint * j + column;
        log_variance[row] = 2 * parameters[2 * j] + std::log(density(h, knee) / total);
        derivative(row, 2 * j) = 2;
        derivative(row, 2 * j + 1) = density_slope(h, knee) - slope / total;
      }
    }
  }
};

}  // namespace

LinearBlockPtr make_joint_map_block() { return std::make_shared<JointMapBlock>(); }

}  // namespace trammel
