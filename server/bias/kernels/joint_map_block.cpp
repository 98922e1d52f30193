#include "server/bias/kernels/joint_map_block.h"

#include <algorithm>
#include <cmath>

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kHarmonicsBefore = 48;  // in models without a learned power
constexpr double kPowerBefore = 2;      // of theirs
constexpr Index kFewestHarmonics = 48;
constexpr Index kMostHarmonics = 112;    // a finer one gains little and costs as much
constexpr Index kMostReadable = 500;     // of a stored model
constexpr Index kObservationsEach = 16;  // for a harmonic of all joints: more would explain noise
constexpr double kTypicalAmplitude = 1e-4;  // rad: 0.1 mm at 1 m, as gears have it
constexpr double kTypicalKnee = 6.0;   // harmonic: gear errors of an arm begin to fall off there
constexpr double kTypicalPower = 1.6;  // 1: amplitudes that fall as 1/h; 2: as 1/h²
constexpr double kAmplitudeSpread =
    2.0;  // in logs, one standard deviation: a factor between a seventh and seven
constexpr double kKneeSpread = 0.7;       // in logs: from half to twice the harmonic
constexpr double kPowerSpread = 0.4;      // in logs: from 1.1 to 2.4
constexpr double kHarmonicsSpread = 1.0;  // without effect, since the harmonics are not searched

/// The two numbers that define the spectrum of a joint.
struct Spectrum {
  double knee, power;
};

/// 1 / (1 + (h/knee)²)^power; power 2 is the spectral density of a Matérn 3/2 process.
double density(Index harmonic, const Spectrum& spectrum) {
  return std::pow(1 + std::pow(static_cast<double>(harmonic) / spectrum.knee, 2), -spectrum.power);
}

/// Derivative of its logarithm by log knee and log power.
Eigen::Vector2d density_slope(Index harmonic, const Spectrum& spectrum) {
  const double ratio = std::pow(static_cast<double>(harmonic) / spectrum.knee, 2);
  return {2 * spectrum.power * ratio / (1 + ratio), -spectrum.power * std::log1p(ratio)};
}

/// Hyperparameters of each joint: log amplitude (rad), log knee and, where it is learned, log
/// power; then, once, the log of the number of harmonics, which stays.
class JointMapBlock final : public LinearBlock {
 public:
  /// The block of a model without a learned power.
  JointMapBlock() : harmonics_(kHarmonicsBefore) {}
  JointMapBlock(Index harmonics, Index told) : harmonics_(harmonics), told_(told) {}

  std::string_view name() const override { return "joint_map"; }
  Index column_count(const BiasFeatures& shape) const override {
    return columns_of_joint() * shape.by_joint.cols();
  }
  Index parameter_count(const BiasFeatures& shape) const override {
    return each() * shape.by_joint.cols() + (told_ ? 1 : 0);
  }
  VectorXd start(const BiasFeatures& shape) const override {
    return of_joints(shape,
                     {std::log(kTypicalAmplitude), std::log(kTypicalKnee), std::log(kTypicalPower)},
                     std::log(static_cast<double>(told_.value_or(0))));
  }
  VectorXd spread(const BiasFeatures& shape) const override {
    return of_joints(shape, {kAmplitudeSpread, kKneeSpread, kPowerSpread}, kHarmonicsSpread);
  }

  // For each joint J_j, then J_j cos(h g_j) and J_j sin(h g_j), g_j the angle of its gear. A
  // harmonic is the one before, turned by g_j.
  void columns(const JointVector& q, const BiasFeatures& features,
               Eigen::Ref<MatrixXd> out) const override {
    const JointVector& gears = features.gears.size() > 0 ? features.gears : q;
    for (Index j = 0; j < features.by_joint.cols(); ++j) {
      const Vector6 J = features.by_joint.col(j);
      const double cosine = std::cos(gears[j]);
      const double sine = std::sin(gears[j]);
      double c = 1;
      double s = 0;
      out.col(columns_of_joint() * j) = J;
      for (Index h = 1; h <= harmonics_; ++h) {
        const double turned = c * cosine - s * sine;
        s = s * cosine + c * sine;
        c = turned;
        out.col(columns_of_joint() * j + 2 * h - 1) = c * J;
        out.col(columns_of_joint() * j + 2 * h) = s * J;
      }
    }
  }

  void log_variance(const BiasFeatures& shape, const VectorXd& parameters,
                    Eigen::Ref<VectorXd> log_variance,
                    Eigen::Ref<MatrixXd> derivative) const override {
    for (Index j = 0; j < shape.by_joint.cols(); ++j) {
      const Index own = each() * j;
      const Spectrum spectrum{std::exp(parameters[own + 1]),
                              told_ ? std::exp(parameters[own + 2]) : kPowerBefore};
      double total = 0;
      Eigen::Vector2d slope = Eigen::Vector2d::Zero();
      for (Index h = 0; h <= harmonics_; ++h) {
        total += density(h, spectrum);
        slope += density(h, spectrum) * density_slope(h, spectrum);
      }
      for (Index column = 0; column < columns_of_joint(); ++column) {
        const Index h = (column + 1) / 2;
        const Index row = columns_of_joint() * j + column;
        log_variance[row] = 2 * parameters[own] + std::log(density(h, spectrum) / total);
        derivative(row, own) = 2;
        derivative.row(row).segment(own + 1, each() - 1) =
            (density_slope(h, spectrum) - slope / total).head(each() - 1).transpose();
      }
    }
  }

 private:
  Index columns_of_joint() const { return 2 * harmonics_ + 1; }
  Index each() const { return told_ ? 3 : 2; }
  VectorXd of_joints(const BiasFeatures& shape, const Eigen::Vector3d& of_joint,
                     double of_all) const {
    VectorXd all(parameter_count(shape));
    for (Index j = 0; j < shape.by_joint.cols(); ++j)
      all.segment(each() * j, each()) = of_joint.head(each());
    if (told_) all[all.size() - 1] = of_all;
    return all;
  }

  Index harmonics_;
  std::optional<Index> told_;
};

}  // namespace

LinearBlockPtr make_joint_map_block() { return std::make_shared<JointMapBlock>(); }

Index harmonics_for(Index observations) {
  return std::clamp(observations / kObservationsEach, kFewestHarmonics, kMostHarmonics);
}

std::optional<Index> harmonics_in(const VectorXd& block_hyperparameters, Index joints) {
  if (block_hyperparameters.size() != 3 * joints + 1) return std::nullopt;
  const double harmonics = std::exp(block_hyperparameters[block_hyperparameters.size() - 1]);
  if (!(harmonics >= 0.5 && harmonics < static_cast<double>(kMostReadable) + 0.5))
    return std::nullopt;
  return static_cast<Index>(std::lround(harmonics));
}

SpelledBias with_harmonics(SpelledBias bias, Index harmonics, Index told) {
  for (LinearBlockPtr& block : bias.blocks) {
    if (block->name() == JointMapBlock().name())
      block = std::make_shared<JointMapBlock>(harmonics, told);
  }
  return bias;
}

}  // namespace trammel
