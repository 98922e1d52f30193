#include "server/trainer/extrapolation.h"

#include <algorithm>
#include <cmath>

#include "server/compensate/domain.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeftOut = 1.0 / 3.0;  // of a joint's range, at one end
constexpr double kLeastRange = 0.02;    // rad or m; over less a slope is noise
constexpr Index kLeastAsked = 5;
constexpr Index kLeastRest = 10;

/// Squared slope of the poses `asked`, which are `distance` away from the `rest`.
double squared_slope(const LeftOut& poses, const std::vector<Index>& asked, const std::vector<Index>& rest,
                     const VectorXd& distance) {
  const auto anew = poses.without(asked);
  if (!anew) return 0;
  // About the rest's mean: a constant is known, and what of it is not taken outside is counted there.
  const MatrixXd known = anew->residual_B(rest, Eigen::all);
  const Eigen::RowVector3d mean = known.colwise().mean();
  const MatrixXd missed = anew->residual_B(asked, Eigen::all).rowwise() - mean;
  const double expected = (known.rowwise() - mean).squaredNorm() / 3 / static_cast<double>(rest.size());
  const double surplus = missed.squaredNorm() / 3 - expected * static_cast<double>(asked.size()) - anew->variance.sum();
  return std::max(surplus, 0.0) / distance.squaredNorm();
}

/// The worse of both ends; empty where they cannot be asked.
std::optional<double> squared_slope(const LeftOut& poses, Index j, const Joint& joint) {
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
    if (static_cast<Index>(asked.size()) < kLeastAsked || static_cast<Index>(rest.size()) < kLeastRest) continue;
    const Eigen::Map<const VectorXd> away(distance.data(), static_cast<Index>(distance.size()));
    worst = std::max(worst.value_or(0), squared_slope(poses, asked, rest, away));
  }
  return worst;
}

}  // namespace

JointVector extrapolation_slope(const LeftOut& poses, const Chain& robot) {
  JointVector slope = JointVector::Zero(robot.size());
  if (poses.size() == 0) return slope;
  std::vector<Index> unknown;
  for (Index j = 0; j < slope.size(); ++j) {
    const std::optional<double> squared = squared_slope(poses, j, robot.joint(static_cast<int>(j)));
    if (!squared) unknown.push_back(j);
    slope(j) = std::sqrt(squared.value_or(0));
  }
  const double largest = slope.maxCoeff();
  for (const Index j : unknown) slope(j) = largest;
  return slope;
}

}  // namespace trammel
