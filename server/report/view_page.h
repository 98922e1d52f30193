#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

namespace trammel {

/// A pose to look at.
struct ViewedPose {
  std::string name;  ///< text: `12`, `p30 drill.mod:41`
  PoseContext context;
  bool measured = true;  ///< at it the tracker must see the target
};

/// The poses of a plan or a program, in order, before anything is measured or moved.
struct Viewed {
  std::string what = {};               ///< `plan.csv`; empty: the cell alone, at its rest pose
  std::vector<ViewedPose> poses = {};  ///< checked against the cell
  std::vector<std::string> left = {};  ///< what has no joints, and why
};

/// What a view finds of the poses.
struct ViewFindings {
  std::size_t poses = 0, touching = 0, unseen = 0, outside = 0;
};
[[nodiscard]] ViewFindings view_findings(const Cell& cell, const Viewed& viewed);

/// The arm with its links as capsules, workspace, obstacles, tracker and lines of sight, and the
/// poses in order, to be turned and stepped through. HTML with everything inside; opens without a
/// network.
[[nodiscard]] std::string view_page(const Cell& cell, const Viewed& viewed);

}  // namespace trammel
