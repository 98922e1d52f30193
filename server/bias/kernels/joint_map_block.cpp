#include <cmath>

#include "server/bias/kernels/linear_block.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kHarmonics = 48;
constexpr Index kColumns = 2 * kHarmonics + 1;
const double kAmplitude = 1e-4;  // rad, typical of gears
const double kKnee = 6.0;        // harmonic
constexpr double kAmplitudeSpread = 2.0;
constexpr double kKneeSpread = 0.7;

/// 1 / (1 + (h/knee)²)²: the spectral density of a Matérn 3/2 process.
double density(Index harmonic, double knee) {
  return std::pow(1 + std::pow(static_cast<double>(harmonic) / knee, 2), -2);
}

/// Its logarithmic derivative by log knee.
double density_slope(Index harmonic, double knee) {
  const double ratio = std::pow(static_cast<double>(harmonic) / knee, 2);
  return 4 * ratio / (1 + ratio);
}

class JointMapBlock final : public LinearBlock {
 public:
  std::string_view name() const override { return "joint_map"; }
  Index column_count(const BiasFeatures& shape) const override { return kColumns * shape.by_joint.cols(); }
  Index parameter_count(const BiasFeatures& shape) const override { return 2 * shape.by_joint.cols(); }
  VectorXd start(const BiasFeatures& shape) const override {
    return Eigen::Vector2d(std::log(kAmplitude), std::log(kKnee)).replicate(shape.by_joint.cols(), 1);
  }
  VectorXd spread(const BiasFeatures& shape) const override {
    return Eigen::Vector2d(kAmplitudeSpread, kKneeSpread).replicate(shape.by_joint.cols(), 1);
  }

  // For each joint J_j, then J_j cos(h q_j) and J_j sin(h q_j), each harmonic the one before turned by q_j.
  void columns(const JointVector& q, const BiasFeatures& features, Eigen::Ref<MatrixXd> out) const override {
    for (Index j = 0; j < features.by_joint.cols(); ++j) {
      const Vector6 J = features.by_joint.col(j);
      const double cosine = std::cos(q[j]);
      const double sine = std::sin(q[j]);
      double c = 1;
      double s = 0;
      out.col(kColumns * j) = J;
      for (Index h = 1; h <= kHarmonics; ++h) {
        const double turned = c * cosine - s * sine;
        s = s * cosine + c * sine;
        c = turned;
        out.col(kColumns * j + 2 * h - 1) = c * J;
        out.col(kColumns * j + 2 * h) = s * J;
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
      for (Index column = 0; column < kColumns; ++column) {
        const Index h = (column + 1) / 2;
        const Index row = kColumns * j + column;
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
