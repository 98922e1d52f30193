#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"

/// Measuring poses.
namespace trammel {

using JointRanges = std::vector<std::pair<double, double>>;  // rad, lower and upper end of each joint

/// The cell's joint ranges, or the robot's limits where it gives none. Refuses a joint without any finite range.
[[nodiscard]] Result<JointRanges> planning_ranges(const Cell& cell);

/// `count` joint vectors (rows, rad) by Latin hypercube sampling: each joint's range is cut into `count` equal slices
/// and every slice is used once (source section 5.1.3). Same seed, same rows.
[[nodiscard]] Eigen::MatrixXd latin_hypercube(const JointRanges& ranges, int count, std::uint64_t seed);

struct PlanOptions {
  int count = 0;
  std::uint64_t seed = 1;
};

/// `count` poses of the cell (rows, rad): a Latin hypercube, of which only poses inside the cell's workspace (with its
/// first tool) are kept; drawn larger until enough are. Refuses when fewer than 1 in 1000 candidates fits.
[[nodiscard]] Result<Eigen::MatrixXd> plan_poses(const Cell& cell, const PlanOptions& options);

}  // namespace trammel
