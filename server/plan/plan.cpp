#include "server/plan/plan.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "server/base/units.h"

namespace trammel {

Result<JointRanges> planning_ranges(const Cell& cell) {
  if (!cell.joint_ranges.empty()) return cell.joint_ranges;
  JointRanges ranges;
  for (int i = 0; i < cell.robot.size(); ++i) {
    const Joint& joint = cell.robot.joint(i);
    if (!std::isfinite(joint.lower) || !std::isfinite(joint.upper)) {
      return refused("cell {}: joint {} has no limits; give joint_ranges_deg", cell.name, i + 1);
    }
    ranges.emplace_back(joint.lower, joint.upper);
  }
  return ranges;
}

Eigen::MatrixXd latin_hypercube(const JointRanges& ranges, int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  Eigen::MatrixXd q(count, static_cast<Eigen::Index>(ranges.size()));
  std::vector<int> slice(static_cast<std::size_t>(count));
  for (std::size_t j = 0; j < ranges.size(); ++j) {
    std::iota(slice.begin(), slice.end(), 0);
    std::shuffle(slice.begin(), slice.end(), random);
    for (int i = 0; i < count; ++i) {
      const double share = (slice[static_cast<std::size_t>(i)] + unit(random)) / count;
      q(i, static_cast<Eigen::Index>(j)) = ranges[j].first + share * (ranges[j].second - ranges[j].first);
    }
  }
  return q;
}

namespace {

/// At the robot's believed place: this is a plan, not a measurement.
bool inside_workspace(const Cell& cell, const JointVector& q) {
  if (!cell.workspace) return true;
  const Pose X_FT = cell.tools.begin()->second.value_or(Pose::Identity());
  const Vector3 p = (cell.robot.flange_pose(q) * X_FT).translation();
  return (p.array() >= cell.workspace->lower.array()).all() && (p.array() <= cell.workspace->upper.array()).all();
}

}  // namespace

Result<Eigen::MatrixXd> plan_poses(const Cell& cell, const PlanOptions& options) {
  if (options.count < 1) return failure(ErrorCode::kUsage, "a plan of {} poses; at least 1 is needed", options.count);
  const Result<JointRanges> ranges = planning_ranges(cell);
  if (!ranges) return tl::make_unexpected(ranges.error());
  for (int factor = 1; factor <= 1000; factor *= 2) {
    const Eigen::MatrixXd candidates = latin_hypercube(*ranges, options.count * factor, options.seed);
    std::vector<Eigen::Index> kept;
    for (Eigen::Index i = 0; i < candidates.rows() && static_cast<int>(kept.size()) < options.count; ++i) {
      if (inside_workspace(cell, candidates.row(i).transpose())) kept.push_back(i);
    }
    if (static_cast<int>(kept.size()) == options.count) return Eigen::MatrixXd(candidates(kept, Eigen::all));
  }
  return refused("cell {}: fewer than 1 in 1000 poses of the joint ranges lies in the workspace", cell.name);
}

}  // namespace trammel
