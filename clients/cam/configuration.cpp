#include "clients/cam/configuration.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/units.h"
#include "server/robot/offset_wrist.h"
#include "server/robot/wrist.h"

namespace trammel::cam {

namespace {

constexpr double kNoBranch = 1e9;
constexpr int kBranches = 8;
constexpr double kOpen = 0.01;        // rad: a wrist that is open more decides joints 4 and 6
constexpr double kStretched = 1e-9;   // rad: a wrist that is open less is stretched
constexpr double kSameJoints = 1e-6;  // rad
constexpr double kAsNear =
    1e-2;  // of the way: how a controller weighs its joints is not known to more

/// True if one way is shorter. The weights that controllers give the joints are not published. So
/// ways that differ by less than kAsNear are decided only if their sums and their longest joints
/// agree.
bool is_nearer(const JointVector& way, const JointVector& other) {
  if (other.norm() - way.norm() > kSameJoints + kAsNear * way.norm()) return true;
  return other.lpNorm<1>() - way.lpNorm<1>() > kSameJoints &&
         way.lpNorm<Eigen::Infinity>() - other.lpNorm<Eigen::Infinity>() < kSameJoints;
}

/// Describes a branch that needs joints far outside the stated quarter turns: the joints and their
/// turns. A stretched wrist leaves joints 4 and 6 open.
std::string contradiction(const Configuration& said, const JointVector& q) {
  std::vector<std::string> joints;
  for (std::size_t j = 0; said.conf && j < said.near.size(); ++j) {
    const double value = q(static_cast<Eigen::Index>(j));
    const bool open = j < 3 || std::abs(q(4)) > kOpen;
    if (!said.near[j] || !open || std::abs(value - *said.near[j]) <= kPi / 4 + kNextQuarter)
      continue;
    joints.push_back(fmt::format("joint {} at {:.1f} deg and not at {:.0f} to {:.0f} deg", j + 1,
                                 to_deg(value), to_deg(*said.near[j] - kPi / 4),
                                 to_deg(*said.near[j] + kPi / 4)));
  }
  for (std::size_t j = 0; j < said.signs.size(); ++j) {
    const double value = q(static_cast<Eigen::Index>(j));
    const bool open = j < 3 || std::abs(q(4)) > kOpen;
    if (!said.signs[j] || !open || std::abs(value) <= kOpen || (value < 0) == (*said.signs[j] < 0))
      continue;
    joints.push_back(fmt::format("joint {} is at {:.1f} deg", j + 1, to_deg(value)));
  }
  if (joints.empty()) return "";
  if (!said.conf)
    return fmt::format("its status and turn contradict each other, or what reaches the pose: {}",
                       fmt::join(joints, ", "));
  return fmt::format(
      "its configuration contradicts itself: branch {} has {}; the branch is followed", *said.conf,
      fmt::join(joints, ", "));
}

/// Keeps joint 4 where the wrist is stretched, since it may then have any angle.
JointVector with_joint_4_held(const Chain& arm, const JointVector& q, const JointVector& before) {
  const auto wrist = wrist_opening(arm, q, kStretched);
  if (!wrist) return q;
  const JointVector held = turned_idly(arm, q, *wrist, before(3));
  return arm.joint_outside_limits(held) ? q : held;
}

/// The chain without joints in front.
Result<Chain> arm_of(const Chain& robot, std::size_t first) {
  std::vector<Joint> joints;
  for (int j = static_cast<int>(first); j < robot.size(); ++j) joints.push_back(robot.joint(j));
  return Chain::make(robot.name(), std::move(joints));
}

/// Height of the elbow, where joint 3 is.
double elbow_height(const Chain& arm, const JointVector& q) {
  const std::vector<LinkGeometry> links = arm.links_at(q);
  Pose X = Pose::Identity();
  for (std::size_t i = 0; i < 2; ++i) {
    const LinkGeometry& link = links[i];
    X = X * Eigen::Translation3d(0, 0, link.d) * Eigen::AngleAxisd(link.theta, Vector3::UnitZ()) *
        Eigen::Translation3d(link.a, 0, 0) * Eigen::AngleAxisd(link.alpha, Vector3::UnitX()) *
        Eigen::AngleAxisd(link.beta, Vector3::UnitY());
  }
  return X.translation().z();
}

/// True if a positive joint 5 turns the tool downward where joint 4 is at zero and the arm at its
/// zero.
bool positive_5_bends_down(const Chain& arm) {
  JointVector q = JointVector::Zero(arm.size());
  const Vector3 straight = arm.flange_pose(q).linear().col(2);
  q(4) = 0.2;
  const Vector3 bent = arm.flange_pose(q).linear().col(2);
  return bent.z() < straight.z();
}

/// Chooses turns of joints 1, 4 and 6 within the limits: the turns that the program gives, else the
/// turns nearest to `previous`.
void choose_turns(const Chain& arm, const Configuration& said,
                  const std::optional<JointVector>& previous, JointVector& q) {
  for (int j = 0; j < arm.size(); ++j) {
    const Joint& joint = arm.joint(j);
    const auto index = static_cast<std::size_t>(j);
    const bool has_near = index < said.near.size() && said.near[index].has_value();
    const bool has_turn = index < said.turns.size() && said.turns[index].has_value();
    const bool has_sign = index < said.signs.size() && said.signs[index].has_value();
    double best = q(j);
    double least = kNoBranch;
    for (const double turns : {0.0, 1.0, -1.0, 2.0, -2.0}) {
      const double value = q(j) + 2 * kPi * turns;
      if (value < joint.lower - 1e-9 || value > joint.upper + 1e-9) continue;
      double cost = std::abs(value - (previous ? (*previous)(j) : 0.0)) * 1e-3;
      if (has_near && std::abs(value - *said.near[index]) > kPi / 4 + 0.02) cost += 1;
      if (has_turn && static_cast<int>(std::lround(value / (2 * kPi))) != *said.turns[index])
        cost += 1;
      if (has_sign && (value < 0) != (*said.signs[index] < 0) && std::abs(value) > 1e-6) cost += 1;
      if (cost < least) {
        least = cost;
        best = value;
      }
    }
    q(j) = best;
  }
}

}  // namespace

bool keeps_configuration(const Configuration& said, const std::vector<double>& before,
                         const std::vector<double>& now, double beyond_quarter) {
  // If a program leaves an axis open, the axis keeps its previous value.
  const auto holds = [&](std::size_t axis, const auto& part_of, int wanted) {
    const int part = part_of(now[axis]);
    return part == wanted || (axis < before.size() && part == part_of(before[axis]));
  };
  const auto quarter = [](double deg) { return static_cast<int>(std::floor(deg / 90)); };
  const auto turn = [](double deg) { return static_cast<int>(std::floor((deg + 180) / 360)); };
  const auto sign = [](double deg) { return deg < 0 ? -1 : 1; };
  for (std::size_t axis = 0; axis < now.size(); ++axis) {
    if (axis < said.near.size() && said.near[axis] &&
        std::abs(from_deg(now[axis]) - *said.near[axis]) > kPi / 4 + beyond_quarter &&
        !holds(axis, quarter, quarter(to_deg(*said.near[axis]))))
      return false;
    if (axis < said.turns.size() && said.turns[axis] && !holds(axis, turn, *said.turns[axis]))
      return false;
    if (axis < said.signs.size() && said.signs[axis] && !holds(axis, sign, *said.signs[axis]))
      return false;
  }
  return true;
}

ArmOfProgram::ArmOfProgram(const Chain& robot) : robot_(robot) {
  for (int j = 0; j < robot_.size(); ++j)
    (robot_.joint(j).type == JointType::kRevolute ? turning_ : rails_).push_back(j);
  const bool rail_first = rails_.size() == 1 && rails_[0] == 0;
  Result<Chain> arm = rails_.empty() ? Result<Chain>(robot_) : arm_of(robot_, 1);
  wrist_ = (rails_.empty() || rail_first) && arm && has_spherical_wrist(*arm);
  offset_wrist_ = (rails_.empty() || rail_first) && arm && has_offset_wrist(*arm);
  if (wrist_) bends_down_ = positive_5_bends_down(*arm);
}

std::optional<ArmOfProgram::Rail> ArmOfProgram::arm_on(double rail) const {
  Result<Chain> arm = arm_of(robot_, 1);
  if (!arm) return std::nullopt;
  JointVector q = JointVector::Zero(robot_.size());
  q(0) = rail;
  const JointVector rest = q.tail(robot_.size() - 1);
  return Rail{*arm, robot_.flange_pose(q) * arm->flange_pose(rest).inverse()};
}

std::optional<JointVector> ArmOfProgram::by_branches(const Chain& arm, const Pose& X_BF,
                                                     const Configuration& said,
                                                     const std::optional<JointVector>& previous,
                                                     std::optional<int>& chosen) const {
  struct Candidate {
    int conf = 0;
    JointVector q;
    bool outside = false;
  };
  std::vector<Candidate> candidates;
  for (int conf = 0; conf < kBranches; ++conf) {
    if (said.conf && *said.conf != conf) continue;
    const auto found = joints_of_branch(arm, X_BF, conf, previous);
    if (!found) continue;
    candidates.push_back({conf, *found, arm.joint_outside_limits(*found).has_value()});
    choose_turns(arm, said, previous, candidates.back().q);
  }
  const auto other_elbow = [&](const Candidate& of) -> const Candidate* {
    for (const Candidate& candidate : candidates) {
      if ((candidate.conf ^ of.conf) == 2) return &candidate;
    }
    return nullptr;
  };
  const auto cost = [&](const Candidate& candidate) {
    double sum = (candidate.q - previous.value_or(JointVector::Zero(arm.size()))).norm() * 1e-3;
    if (candidate.outside) sum += 1000;
    if (said.behind_axis_1 && *said.behind_axis_1 != ((candidate.conf & 4) != 0)) sum += 100;
    for (std::size_t j = 0; j < said.signs.size(); ++j) {
      const double value = candidate.q(static_cast<Eigen::Index>(j));
      if (said.signs[j] && (value < 0) != (*said.signs[j] < 0) && std::abs(value) > 1e-6) sum += 10;
    }
    if (said.bends_down && *said.bends_down != (bends_down_ == (candidate.q(4) > 0))) sum += 30;
    if (const Candidate* other = other_elbow(candidate)) {
      if (said.elbow_up &&
          *said.elbow_up != (elbow_height(arm, candidate.q) > elbow_height(arm, other->q)))
        sum += 20;
      if (said.larger_joint_3 && *said.larger_joint_3 != (candidate.q(2) > other->q(2))) sum += 5;
    }
    return sum;
  };
  const Candidate* best = nullptr;
  double least = 0;
  for (const Candidate& candidate : candidates) {
    const double sum = cost(candidate);
    if (best != nullptr && sum >= least) continue;
    best = &candidate;
    least = sum;
  }
  if (best == nullptr) return std::nullopt;
  chosen = best->conf;
  return previous ? with_joint_4_held(arm, best->q, *previous) : best->q;
}

NominalJoints ArmOfProgram::by_descent(const Pose& X_BF, const std::map<int, double>& external,
                                       const std::optional<JointVector>& previous) const {
  JointVector seed = previous.value_or(JointVector::Zero(robot_.size()));
  for (std::size_t k = 0; k < rails_.size(); ++k) {
    const auto value = external.find(static_cast<int>(k));
    if (value == external.end())
      return {std::nullopt, std::nullopt, "the program does not say where the rail is"};
    seed(rails_[k]) = from_mm(value->second);
  }
  if (!previous) {
    return {
        std::nullopt, std::nullopt,
        "the program does not say the arm's configuration, and no motion to joints comes before"};
  }
  const InverseResult found = inverse_kinematics(robot_, X_BF, seed);
  if (found.status == InverseStatus::kUnreachable)
    return {std::nullopt, std::nullopt, "no joints near those before bring the tool there"};
  return {found.q, std::nullopt, ""};
}

template <typename Solve>
NominalJoints ArmOfProgram::on_rail(const Pose& X_BF, const std::map<int, double>& external,
                                    const std::optional<JointVector>& previous,
                                    const Solve& solve) const {
  if (rails_.empty()) return solve(robot_, X_BF, previous);
  const auto value = external.find(0);
  if (value == external.end())
    return {std::nullopt, std::nullopt, "the program does not say where the rail is"};
  const auto on = arm_on(from_mm(value->second));
  if (!on) return {std::nullopt, std::nullopt, "the arm on its rail is not understood"};
  const std::optional<JointVector> before =
      previous ? std::optional<JointVector>(previous->tail(robot_.size() - 1)) : std::nullopt;
  NominalJoints made = solve(on->arm, on->X_BR.inverse() * X_BF, before);
  if (made.q) {
    JointVector q(robot_.size());
    q << from_mm(value->second), *made.q;
    made.q = q;
  }
  return made;
}

NominalJoints ArmOfProgram::joints(const Pose& X_BF, const Configuration& said,
                                   const std::map<int, double>& external,
                                   const std::optional<JointVector>& previous) const {
  if (offset_wrist_ && previous) return nearest(X_BF, external, *previous, false);
  if (!wrist_) return by_descent(X_BF, external, previous);
  return on_rail(X_BF, external, previous,
                 [&](const Chain& arm, const Pose& X_RF, const std::optional<JointVector>& before) {
                   NominalJoints made;
                   made.q = by_branches(arm, X_RF, said, before, made.conf);
                   if (made.q) {
                     made.doubt = contradiction(said, *made.q);
                   } else {
                     made.conf = said.conf;
                     made.why_not =
                         said.conf
                             ? fmt::format("no joints of conf {} bring the tool there", *said.conf)
                             : "no joints bring the tool there";
                   }
                   return made;
                 });
}

std::optional<JointVector> ArmOfProgram::branch(const Chain& arm, const Pose& X_BF, int number,
                                                const JointVector& near) const {
  if (!wrist_) return joints_of_offset_wrist(arm, X_BF, number, near);
  const auto q = joints_of_branch(arm, X_BF, number, near);
  return q ? std::optional<JointVector>(with_joint_4_held(arm, *q, near)) : std::nullopt;
}

std::vector<int> ArmOfProgram::branches_of(const Chain& arm, const JointVector& q) const {
  const Pose X_BF = arm.flange_pose(q);
  std::vector<int> found;
  for (int number = 0; number < kBranches; ++number) {
    const auto same = branch(arm, X_BF, number, q);
    if (same && (*same - q).norm() < kSameJoints) found.push_back(number);
  }
  return found;
}

NominalJoints ArmOfProgram::nearest_branch(const Chain& arm, const Pose& X_BF,
                                           const JointVector& from, bool on_a_line) const {
  const std::vector<int> own = on_a_line ? branches_of(arm, from) : std::vector<int>();
  std::vector<JointVector> found;
  for (int number = 0; number < kBranches; ++number) {
    if (!own.empty() && std::find(own.begin(), own.end(), number) == own.end()) continue;
    const auto q = branch(arm, X_BF, number, from);
    if (q && !arm.joint_outside_limits(*q)) found.push_back(*q);
  }
  if (found.empty())
    return {std::nullopt, std::nullopt, "no joints within the limits bring the tool there"};
  const JointVector best = *std::min_element(
      found.begin(), found.end(),
      [&](const auto& a, const auto& b) { return (a - from).norm() < (b - from).norm(); });
  const bool undecided = std::any_of(found.begin(), found.end(), [&](const JointVector& other) {
    return (other - best).norm() >= kSameJoints && !is_nearer(best - from, other - from);
  });
  if (undecided)
    return {
        std::nullopt, std::nullopt,
        "two postures are equally near to the joints before, and the program does not say which"};
  return {best, std::nullopt, ""};
}

NominalJoints ArmOfProgram::nearest(const Pose& X_BF, const std::map<int, double>& external,
                                    const JointVector& from, bool on_a_line) const {
  if (!wrist_ && !offset_wrist_) return by_descent(X_BF, external, from);
  return on_rail(X_BF, external, from,
                 [&](const Chain& arm, const Pose& X_RF, const std::optional<JointVector>& before) {
                   return nearest_branch(arm, X_RF, *before, on_a_line);
                 });
}

std::optional<JointVector> ArmOfProgram::from_axes(const std::vector<double>& axes,
                                                   const std::map<int, double>& external) const {
  JointVector q(robot_.size());
  if (axes.size() < turning_.size()) return std::nullopt;
  for (std::size_t k = 0; k < turning_.size(); ++k) q(turning_[k]) = from_deg(axes[k]);
  for (std::size_t k = 0; k < rails_.size(); ++k) {
    const auto value = external.find(static_cast<int>(k));
    if (value == external.end()) return std::nullopt;
    q(rails_[k]) = from_mm(value->second);
  }
  return q;
}

std::vector<double> ArmOfProgram::to_axes(const JointVector& q) const {
  std::vector<double> axes;
  for (const int j : turning_) axes.push_back(to_deg(q(j)));
  return axes;
}

JointVector ArmOfProgram::near(const Pose& X_BF, const JointVector& q) const {
  if (rails_.empty()) return inverse_kinematics(robot_, X_BF, q).q;
  std::vector<Joint> joints;
  for (int j = 0; j < robot_.size(); ++j) {
    joints.push_back(robot_.joint(j));
    if (joints.back().type != JointType::kPrismatic) continue;
    joints.back().lower = q(j) - 1e-9;
    joints.back().upper = q(j) + 1e-9;
  }
  const Result<Chain> held = Chain::make(robot_.name(), std::move(joints));
  return held ? inverse_kinematics(*held, X_BF, q).q : q;
}

}  // namespace trammel::cam
