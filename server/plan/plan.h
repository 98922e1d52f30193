#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/result.h"
#include "server/measurement/files/joint_list.h"
#include "server/plan/separation.h"
#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

/// Measuring poses.
namespace trammel {

using JointRanges = std::vector<std::pair<double, double>>;  // rad, lower and upper end of each joint

/// The cell's joint ranges, or the robot's limits where it gives none. Refuses a joint without any finite range.
[[nodiscard]] Result<JointRanges> planning_ranges(const Cell& cell);

/// `count` joint vectors (rows, rad) by Latin hypercube sampling: each joint's range is cut into `count` equal slices
/// and every slice is used once (source section 5.1.3). Same seed, same rows.
[[nodiscard]] Eigen::MatrixXd latin_hypercube(const JointRanges& ranges, int count, std::uint64_t seed);

/// How poses are chosen from those that the cell allows.
enum class PlanCriterion {
  kLatinHypercube,  ///< evenly over the joint ranges
  kObservability,   ///< D-optimal for the parameters of the cell's error sources
  kSeparation       ///< D_s-optimal for one cause beside another
};

struct PlanOptions {
  int count = 0;
  std::uint64_t seed = 1;
  PlanCriterion criterion = PlanCriterion::kLatinHypercube;
  std::string cause = {}, other = {};   ///< of kSeparation: specs as in the cell file
  bool bidirectional = false;           ///< every pose twice, approached from both sides
  bool orientation = true;              ///< false: positions only will be measured
  std::vector<std::string> tools = {};  ///< to measure with in turn; empty: the cell's only one
  std::vector<std::string> payloads = {};
};

/// `count` poses of the cell (rows, rad): a Latin hypercube, of which only poses inside the cell's workspace and in
/// sight of its tracker (with its first tool) are kept, source section 6.1.2; drawn larger until enough are. Refuses
/// when fewer than 1 in 1000 candidates fits, and what Visibility::of() refuses. Only count and seed matter.
[[nodiscard]] Result<Eigen::MatrixXd> plan_poses(const Cell& cell, const PlanOptions& options);

/// Which of the joint vectors in the rows of `q` (rad) plan_poses() could have given and, as a plan needs, can be
/// approached from one side at least. Refuses what plan_poses() refuses of the cell.
[[nodiscard]] Result<std::vector<bool>> plannable(const Cell& cell, const Eigen::MatrixXd& q);

/// What became of the candidates that were drawn; each is counted at the first thing that spoke against it.
struct DrawCount {
  int drawn = 0;
  int outside = 0;  ///< it or the pose it is approached from leaves the workspace
  int unseen = 0;   ///< by the tracker
  int no_way = 0;   ///< beyond a joint limit, or too near to it to be approached
  int kept = 0;
};

struct PlannedPose {
  std::string id;       ///< its number; `12+` and `12-` where it is approached from both sides
  PoseContext context;  ///< joints, approach directions, tool, payload
  JointVector bump;     ///< where it is approached from
};

struct Plan {
  std::vector<PlannedPose> poses;
  DrawCount draw;
  /// Of kObservability and kSeparation: the criterion (nat) of this plan and of a Latin hypercube of as many poses.
  double criterion = 0, criterion_of_latin_hypercube = 0;
  /// Of kSeparation: this plan, a Latin hypercube, and all candidates measured together.
  struct Separation {
    Separability plan, latin_hypercube, candidates;
    std::vector<std::string> hopeless;  ///< parameters of the cause that not even all candidates separate
    std::string needs;                  ///< what would; empty when nothing is hopeless
  };
  std::optional<Separation> separation;
};

/// The poses of `list` (checked against the cell) as a plan: each with the pose it is approached from, on the side that
/// its directions say where they are all the same, else on one that the limits allow. Refuses a pose that lies too near
/// to a limit to be approached.
[[nodiscard]] Result<Plan> plan_of(const Cell& cell, const JointList& list);

/// A plan as the options say, every pose with the pose it is approached from (by default from above, as source section
/// 3.2.4.2). Poses of one tool and payload come together; within them the most telling come first. Refuses as
/// plan_poses(), and unknown causes, tools and payloads.
[[nodiscard]] Result<Plan> make_plan(const std::shared_ptr<const Cell>& cell, const PlanOptions& options);

}  // namespace trammel
