#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/result.h"
#include "server/measurement/files/joint_list.h"
#include "server/plan/check_design.h"
#include "server/plan/separation.h"
#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

/// Which poses to measure.
namespace trammel {

using JointRanges =
    std::vector<std::pair<double, double>>;  // rad, lower and upper end of each joint

/// The cell's joint ranges, or the robot's limits where it gives none. Refuses a joint without any
/// finite range.
[[nodiscard]] Result<JointRanges> planning_ranges(const Cell& cell);

/// `count` joint vectors (rows, rad) by Latin hypercube sampling: each joint's range is cut into
/// `count` equal slices and every slice is used once (source section 5.1.3). The same seed gives
/// the same rows.
[[nodiscard]] Eigen::MatrixXd latin_hypercube(const JointRanges& ranges, int count,
                                              std::uint64_t seed);

/// The criterion for the choice among the poses that the cell allows.
enum class PlanCriterion {
  kLatinHypercube,  ///< evenly over the joint ranges
  kObservability,   ///< D-optimal for the parameters of the cell's error sources
  kSeparation,      ///< D_s-optimal to tell one cause from another
  kCheck            ///< to see whether a single cause has changed: check_design()
};

struct PlanOptions {
  int count = 0;
  std::uint64_t seed = 1;
  PlanCriterion criterion = PlanCriterion::kLatinHypercube;
  std::string cause = {}, other = {};  ///< for kSeparation: sources as written in the cell file
  bool bidirectional = false;  ///< every pose twice, all joints from above and all from below
  bool orientation = true;     ///< false: positions only will be measured
  std::vector<std::string> tools = {};  ///< to measure with in turn; empty: the cell's only one
  std::vector<std::string> payloads = {};
  bool one_way = false;  ///< all joints come to each pose from below: play in the gears does not
                         ///< show, and costs no extra travel
  /// m: the tip of the first tool meets this point in every pose, in varied postures. A base among
  /// the error sources stands for the unknown place of the point. Use with `orientation` false.
  std::optional<Vector3> contact_B = std::nullopt;
};

/// `count` poses of the cell (rows, rad) from a Latin hypercube, keeping the ones inside the
/// workspace and in sight of the tracker, with the first tool (source section 6.1.2). The hypercube
/// is enlarged until enough are left. Refuses a cell where fewer than 1 in 1000 candidates fits,
/// and the same as Visibility::of(). Of the options only count and seed matter.
[[nodiscard]] Result<Eigen::MatrixXd> plan_poses(const Cell& cell, const PlanOptions& options);

/// For each row of `q` (rad), whether plan_poses() could have chosen it and whether it can be
/// approached from at least one side. Refuses the same cells as plan_poses().
[[nodiscard]] Result<std::vector<bool>> plannable(const Cell& cell, const Eigen::MatrixXd& q);

/// The fate of the candidates drawn; each counts for the first reason against it.
struct DrawCount {
  int drawn = 0;
  int outside = 0;   ///< the pose, or its approach, is outside the workspace
  int touching = 0;  ///< a link touches a stated obstacle there, or on its approach's pose
  int unseen = 0;    ///< not in sight of the tracker
  int no_way = 0;    ///< beyond a joint limit, or too near to one to be approached
  int kept = 0;
};

struct PlannedPose {
  std::string id;       ///< its number; `12+` and `12-` for a pose approached from both sides
  PoseContext context;  ///< joints, approach directions, tool, payload
  JointVector bump;     ///< the pose from which it is approached
};

struct Plan {
  std::vector<PlannedPose> poses;
  DrawCount draw;
  /// For kObservability and kSeparation: the criterion (nat) of this plan, and of a Latin hypercube
  /// with equally many poses.
  double criterion = 0, criterion_of_latin_hypercube = 0;
  /// For kSeparation: the separation of the causes by this plan, by a Latin hypercube, and by all
  /// candidates together.
  struct Separation {
    Separability plan, latin_hypercube, candidates;
    std::vector<std::string>
        hopeless;       ///< parameters that not even all candidates together separate
    std::string needs;  ///< the measurement that would separate them; empty if nothing is hopeless
  };
  std::optional<Separation> separation;
  /// For kCheck: the smallest change of each cause that this plan shows with 95 % chance, given the
  /// tracker's noise.
  std::vector<SmallestEffect> smallest;
  /// obstacles_in_words(): what the arm keeps clear of at all poses and their approaches; empty: no
  /// obstacle is stated, and nothing was looked at.
  std::string clear_of = {};
};

/// The poses of `list` (checked against the cell) as a plan, each with the pose of its approach:
/// from the recorded sides if every joint has one, otherwise from planned_sides() as far as the
/// limits allow. Refuses a pose that is too near a limit for an approach.
[[nodiscard]] Result<Plan> plan_of(const Cell& cell, const JointList& list);

/// Makes a plan by the options, each pose with the pose of its approach (source section 3.2.4.2).
/// Each joint comes from above as often as from below, see planned_sides(). Poses of one tool and
/// payload are consecutive, the most informative first. Refuses the same as plan_poses(), and
/// unknown causes, tools and payloads, and a check with every pose twice.
[[nodiscard]] Result<Plan> make_plan(const std::shared_ptr<const Cell>& cell,
                                     const PlanOptions& options);

}  // namespace trammel
