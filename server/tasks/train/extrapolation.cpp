#include "server/tasks/train/extrapolation.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/check.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/compensate/domain.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeftOut = 1.0 / 3.0;  // share of a joint's range that is left out, at one end
constexpr double kLeastRange = 0.02;    // rad or m; over less a slope is noise
constexpr Index kLeastAsked = 5;
constexpr Index kLeastRest = 10;

/// The surplus of the errors at left-out poses over their stated variance, sum of squares of one
/// coordinate, m²; empty if the rest does not determine it.
using Surplus = std::function<std::optional<double>(
    const LeftOut::Without& anew, const std::vector<Index>& asked, const std::vector<Index>& rest)>;

std::optional<double> surplus_of_physics(const LeftOut::Without& anew,
                                         const std::vector<Index>& asked,
                                         const std::vector<Index>& rest) {
  // Uses the kernel mean about the mean of the rest: a constant is known, and the part of it that
  // is not applied outside is counted there.
  const MatrixXd known = anew.residual_B(rest, Eigen::all);
  const Eigen::RowVector3d mean = known.colwise().mean();
  const MatrixXd missed = anew.residual_B(asked, Eigen::all).rowwise() - mean;
  const double expected =
      (known.rowwise() - mean).squaredNorm() / 3 / static_cast<double>(rest.size());
  return missed.squaredNorm() / 3 - expected * static_cast<double>(asked.size()) -
         anew.variance.sum();
}

/// The surplus of the errors at out-of-range poses that the bias's blocks do not explain, with
/// unchanged hyperparameters.
std::optional<double> surplus_of_blocks(const BiasState& state, const LeftOut::Without& anew,
                                        const std::vector<Index>& asked,
                                        const std::vector<Index>& rest) {
  const auto at = [&](const std::vector<Index>& rows) {
    std::vector<BiasFeatures> some;
    for (const Index i : rows) some.push_back(state.features[static_cast<std::size_t>(i)]);
    return some;
  };
  const Result<BiasModel> known =
      BiasModel::restore({state.kernel, state.q(rest, Eigen::all),
                          anew.residual_B(rest, Eigen::all), state.sigma(rest), state.offset,
                          state.hyperparameters, state.block_hyperparameters, at(rest)});
  if (!known) return std::nullopt;
  const std::vector<BiasPrediction> said =
      known->predict_all(state.q(asked, Eigen::all), at(asked));
  double surplus = spelled_bias(state.kernel)->has("parameters") ? 0 : -anew.variance.sum();
  for (std::size_t k = 0; k < asked.size(); ++k) {
    const Vector3 lasting_B = said[k].mean_B - said[k].nearby_B;
    const Vector3 missed_B = anew.residual_B.row(asked[k]).transpose() - lasting_B;
    surplus += (missed_B.squaredNorm() - said[k].nearby_B.squaredNorm() -
                said[k].measured_stddev_B.squaredNorm()) /
               3;
  }
  return surplus;
}

/// The worse of both ends; empty if neither can be tested.
std::optional<double> squared_slope(const LeftOut& poses, Index j, const Joint& joint,
                                    const Surplus& surplus) {
  const double low = poses.q().col(j).minCoeff();
  const double high = poses.q().col(j).maxCoeff();
  if (high - low < kLeastRange) return std::nullopt;
  std::optional<double> worst;
  for (const bool upper : {false, true}) {
    std::vector<Index> asked, rest;
    std::vector<double> distance;
    for (Index i = 0; i < poses.size(); ++i) {
      const double inward = upper ? high - poses.q()(i, j) : poses.q()(i, j) - low;
      const double beyond = kLeftOut * (high - low) - inward;
      (beyond > 0 ? asked : rest).push_back(i);
      if (beyond > 0) distance.push_back(distance_beyond(joint, beyond));
    }
    if (static_cast<Index>(asked.size()) < kLeastAsked ||
        static_cast<Index>(rest.size()) < kLeastRest)
      continue;
    const Eigen::Map<const VectorXd> away(distance.data(), static_cast<Index>(distance.size()));
    const auto anew = poses.without(asked);
    const std::optional<double> missed = anew ? surplus(*anew, asked, rest) : std::nullopt;
    if (missed) worst = std::max(worst.value_or(0), std::max(*missed, 0.0) / away.squaredNorm());
  }
  return worst;
}

/// Empty where no joint can be asked.
std::optional<JointVector> slope_of(const LeftOut& poses, const Chain& robot,
                                    const Surplus& surplus) {
  if (poses.size() == 0) return std::nullopt;
  JointVector slope = JointVector::Zero(robot.size());
  std::vector<Index> unknown;
  for (Index j = 0; j < slope.size(); ++j) {
    const std::optional<double> squared =
        squared_slope(poses, j, robot.joint(static_cast<int>(j)), surplus);
    if (!squared) unknown.push_back(j);
    slope(j) = std::sqrt(squared.value_or(0));
  }
  if (static_cast<Index>(unknown.size()) == slope.size()) return std::nullopt;
  const double largest = slope.maxCoeff();
  for (const Index j : unknown) slope(j) = largest;
  return slope;
}

}  // namespace

JointVector extrapolation_slope(const LeftOut& poses, const Chain& robot) {
  return slope_of(poses, robot, surplus_of_physics).value_or(JointVector::Zero(robot.size()));
}

JointVector extrapolation_slope(const LeftOut& poses, const Chain& robot, const BiasModel& bias) {
  TRAMMEL_CHECK(bias.has_blocks() && bias.state().q.rows() == poses.size());
  const auto beyond_blocks = slope_of(
      poses, robot, [&](const LeftOut::Without& anew, const auto& asked, const auto& rest) {
        return surplus_of_blocks(bias.state(), anew, asked, rest);
      });
  return beyond_blocks ? *beyond_blocks : extrapolation_slope(poses, robot);
}

}  // namespace trammel
