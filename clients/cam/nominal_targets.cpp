#include "clients/cam/nominal_targets.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "clients/cam/flow.h"
#include "clients/cam/stated_robot.h"
#include "clients/cam/taught.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/exchange/si.h"

namespace trammel::cam {

namespace {

constexpr double kLargest = 1e7;      // of a target's numbers, mm or deg
constexpr double kSameJoints = 1e-6;  // rad
constexpr const char* kNotSaid =
    "the controller takes the joints nearest to those before, and the program does not say these";

constexpr const char* kOtherStatus =
    "its status and turn are of another posture than the motion before leaves, and a line keeps "
    "that one";

class Finding {
 public:
  Finding(const Program& program, const ArmOfProgram& arm, const CellTools& cell,
          std::vector<ToolChoice> tools)
      : program_(program), arm_(arm), cell_(cell), found_{std::move(tools), {}, {}} {
    found_.targets.resize(program.targets.size());
  }

  NominalTargets find() {
    note_tools();
    note_unused();
    find_moving_axes();
    find_joints();
    const auto doubts =
        std::count_if(found_.targets.begin(), found_.targets.end(),
                      [](const NominalTarget& target) { return !target.doubt.empty(); });
    if (doubts > 0)
      found_.notes.push_back(
          fmt::format("{} targets: what the program says of the configuration contradicts itself, "
                      "or the motion before; the receipt says what is followed",
                      doubts));
    return std::move(found_);
  }

 private:
  void note_tools() {
    found_.contradictions = contradictions_of(program_, arm_.robot(), cell_);
    found_.notes = program_.notes;
    for (const std::string& note : notes_on_base(program_, cell_)) found_.notes.push_back(note);
    if (const std::string note = note_on_taught_targets(program_); !note.empty())
      found_.notes.push_back(note);
    const auto add = [&](const std::string& note) {
      if (!note.empty() &&
          std::find(found_.notes.begin(), found_.notes.end(), note) == found_.notes.end())
        found_.notes.push_back(note);
    };
    for (const ToolChoice& choice : found_.tools) {
      add(choice.note);
      add(choice.load_note);
    }
  }

  /// Notes points without any motion to them. They do not count as uncorrected.
  void note_unused() {
    constexpr std::size_t kMost = 5;
    std::vector<std::string> points;
    for (const LeftAlone& left : program_.left) {
      if (left.motion.empty())
        points.push_back(fmt::format("{} ({} line {})", shown(left.name),
                                     program_.files[left.file].name, left.line));
    }
    if (points.empty()) return;
    const std::size_t more = points.size() - std::min(points.size(), kMost);
    points.resize(points.size() - more);
    found_.notes.push_back(
        fmt::format("no motion in these files goes to {}{}: what is not used stays as it is",
                    fmt::join(points, ", "), more > 0 ? fmt::format(" and {} more", more) : ""));
  }

  /// Finds external axes that are not the cell's rail and that move: the robot stands still only if
  /// they do.
  void find_moving_axes() {
    std::map<int, std::set<double>> values;
    for (const ProgramTarget& target : program_.targets) {
      for (const auto& [axis, value] : target.external) values[axis].insert(value);
    }
    const int rails = arm_.has_rail() ? 1 : 0;
    for (auto& [axis, seen] : values) {
      if (carries_robot(program_, axis)) seen.insert(0);
      if (axis >= rails && seen.size() > 1) moving_axes_.insert(axis);
    }
    // These move beneath every target, whichever axes it states.
    for (const int axis : program_.moved_axes) {
      if (axis >= rails) moving_axes_.insert(axis);
    }
    std::erase_if(moving_axes_,
                  [&](int axis) { return cell_.idle_axes.contains(axis_called(program_, axis)); });
  }

  /// The posture in which a motion leaves the arm.
  struct Stand {
    std::optional<JointVector> q;  ///< empty: not known
    bool posture_only = false;     ///< somewhere on a line from there
    bool operator==(const Stand& other) const {
      if (posture_only != other.posture_only || q.has_value() != other.q.has_value()) return false;
      return !q || (*q - *other.q).norm() < kSameJoints;
    }
  };

  void find_joints() {
    done_.assign(program_.targets.size(), false);
    stands_.assign(program_.moves.size(), std::nullopt);
    // A loop leads back to motions that stand above.
    do {
      changed_ = false;
      for (std::size_t m = 0; m < program_.moves.size(); ++m) follow(m);
    } while (changed_);
    for (const ProgramMove& move : program_.moves) {
      for (const std::size_t t : move.targets) {
        if (!done_[t]) leave_open(t, kNotSaid);
      }
    }
    for (std::size_t t = 0; t < program_.targets.size(); ++t) {
      if (!done_[t]) by_configuration(t, program_.targets[t].file);
    }
  }

  void follow(std::size_t m) {
    const ProgramMove& move = program_.moves[m];
    std::vector<Stand> from = stands_before(move);
    if (from.empty() && move.choice != JointChoice::kByConfiguration && move.near.empty() &&
        move.axes.empty())
      return;
    const Stand line{from.size() == 1 ? from[0].q : std::nullopt, true};
    for (const std::size_t t : move.targets) {
      const bool is_open = move.choice != JointChoice::kByConfiguration &&
                           !is_joints(program_.targets[t].coordinates);
      if (is_open)
        find_open(t, move, from);
      else
        by_configuration(t, move.file);
      from = {{found_.targets[t].q}};
    }
    const bool known = !move.targets.empty() && !move.left_some && from[0].q;
    Stand now = known ? from[0] : move.choice == JointChoice::kOnALine ? line : Stand{};
    if (!known && !move.axes.empty()) now = {arm_.from_axes(move.axes, {})};
    if (stands_[m] == now) return;
    stands_[m] = now;
    changed_ = true;
  }

  /// The postures in which it may begin, as far as they are found already.
  [[nodiscard]] std::vector<Stand> stands_before(const ProgramMove& move) const {
    std::vector<Stand> from;
    for (const std::size_t m : move.before) {
      const std::optional<Stand> stand = m == kNoMotion ? Stand{} : stands_[m];
      if (stand && std::find(from.begin(), from.end(), *stand) == from.end())
        from.push_back(*stand);
    }
    return from;
  }

  /// Finds the joints of a target. An unspecified configuration follows from the previous motion in
  /// this file, wherever the targets are.
  void by_configuration(std::size_t t, std::size_t file) {
    std::optional<JointVector>& previous = last_[file];
    if (!done_[t] && !previous) note_beginning(t);
    if (!done_[t] && prepare(t)) take(t, as_said(t, previous));
    done_[t] = true;
    if (found_.targets[t].q) previous = found_.targets[t].q;
  }

  /// If a program does not state its first posture, the robot starts in its present posture.
  void note_beginning(std::size_t t) {
    const ProgramTarget& target = program_.targets[t];
    const bool may_say_it = program_.dialect == "krl" || program_.dialect == "inform";
    if (noted_beginning_ || !may_say_it || target.configuration.said() ||
        is_joints(target.coordinates))
      return;
    noted_beginning_ = true;
    found_.notes.push_back(fmt::format(
        "{} ({} line {}): the program begins there and does not say the arm's posture. The one "
        "nearest to joints of zero is taken, the robot takes the one that it stands in",
        shown(target.name), program_.files[target.file].name, target.line));
  }

  /// Finds the joints of a target that the controller chooses by the previous joints. All paths to
  /// it must give the same result.
  void find_open(std::size_t t, const ProgramMove& move, std::vector<Stand> from) {
    if (!move.near.empty())
      from = {{arm_.from_axes(in_degrees(Coordinates::kJointRadians, move.near), {})}};
    for (const Stand& stand : from) {
      NominalTarget& target = found_.targets[t];
      const NominalTarget was = target;
      if (!was.why_not.empty()) return;
      const bool on_a_line = move.choice == JointChoice::kOnALine;
      done_[t] = true;
      if (!prepare(t)) return;
      const bool enough = stand.q && (!stand.posture_only || on_a_line);
      if (!enough && !program_.targets[t].configuration.said()) return leave_open(t, kNotSaid);
      if (!enough) note_as_said(t);
      take(t, enough ? arm_.nearest(flange_of(t), program_.targets[t].external, *stand.q, on_a_line)
                     : as_said(t, {}));
      if (enough) note_other_status(t, *stand.q);
      if (!was.q || !target.q) continue;
      if (!same_posture(*was.q, *target.q))
        return leave_open(t, "motions come to it in different postures");
      target = was;
    }
  }

  void note_as_said(std::size_t t) {
    if (noted_as_said_) return;
    noted_as_said_ = true;
    const ProgramTarget& target = program_.targets[t];
    found_.notes.push_back(
        fmt::format("{} ({} line {}): the controller takes the joints nearest to those before, "
                    "which the program does not say; the configuration of the target is taken",
                    shown(target.name), program_.files[target.file].name, target.line));
  }

  /// Notes targets whose stored status or turns differ; on a line, branch numbers are placeholders
  /// that the controller ignores.
  void note_other_status(std::size_t t, const JointVector& before) {
    const Configuration& stored = program_.targets[t].configuration;
    NominalTarget& target = found_.targets[t];
    if (!stored.said() || stored.conf || !target.q) return;
    const std::optional<JointVector> said = as_said(t, before).q;
    if (said && !same_posture(*said, *target.q)) target.doubt = kOtherStatus;
  }

  void leave_open(std::size_t t, const char* why) {
    found_.targets[t] = {};
    found_.targets[t].why_not = why;
    done_[t] = true;
  }

  /// Whole turns aside.
  static bool same_posture(const JointVector& a, const JointVector& b) {
    return (a - b).unaryExpr([](double d) { return std::remainder(d, 2 * kPi); }).norm() <
           kSameJoints;
  }

  /// True if there is a pose whose joints must be found; joint targets need no search.
  bool prepare(std::size_t t) {
    const ProgramTarget& target = program_.targets[t];
    const ToolChoice& choice = found_.tools[target.tool];
    found_.targets[t] = {};
    NominalTarget& found = found_.targets[t];
    found.why_not = choice.why_not;
    if (!found.why_not.empty()) return false;
    for (const int axis : moving_axes_) {
      if (!target.external.contains(axis) && !program_.moved_axes.contains(axis)) continue;
      found.why_not = fmt::format(
          "{0} {1}, and the cell has none; --idle-axis '{0}' says that it carries neither robot "
          "nor part",
          axis_called(program_, axis),
          carries_robot(program_, axis) ? "is not at zero throughout" : "moves");
      return false;
    }
    const auto beyond = [](double number) { return !(std::abs(number) < kLargest); };
    if (std::any_of(target.numbers.begin(), target.numbers.end(), beyond)) {
      found.why_not = "a number that no robot reaches";
      return false;
    }
    if (!is_joints(target.coordinates)) return true;
    const auto q = arm_.from_axes(in_degrees(target, target.numbers), target.external);
    if (!q) {
      found.why_not = "the program does not say where the rail is";
      return false;
    }
    found.asked.joint_target = true;
    found.asked.seed_rad = exchange::asked_from_si(*q, exchange::rails_of(arm_.robot()));
    found.q = *q;
    return false;
  }

  /// The flange of a pose that is prepared.
  [[nodiscard]] Pose flange_of(std::size_t t) const {
    const ProgramTarget& target = program_.targets[t];
    const Pose X_BT =
        program_.frames[target.frame].X_BO * pose_of(target.coordinates, target.numbers);
    return X_BT * cell_.tools.at(found_.tools[target.tool].tool).inverse();
  }

  void take(std::size_t t, const NominalJoints& joints) {
    const ProgramTarget& target = program_.targets[t];
    NominalTarget& found = found_.targets[t];
    found.asked.pose = exchange::from_si(program_.frames[target.frame].X_BO *
                                         pose_of(target.coordinates, target.numbers));
    found.doubt = joints.doubt;
    if (joints.q) {
      found.asked.seed_rad = exchange::asked_from_si(*joints.q, exchange::rails_of(arm_.robot()));
      found.q = *joints.q;
      if (outside(*joints.q) && joints.conf && !arm_.has_rail()) {
        // Without a seed, so that the answer names the branches that would reach it.
        found.asked.seed_rad.clear();
        found.asked.conf = joints.conf;
      }
    } else if (joints.conf && !arm_.has_rail()) {
      found.asked.conf = joints.conf;
    } else {
      found.why_not = joints.why_not;
    }
  }

  [[nodiscard]] NominalJoints as_said(std::size_t t,
                                      const std::optional<JointVector>& previous) const {
    const ProgramTarget& target = program_.targets[t];
    return arm_.joints(flange_of(t), target.configuration, target.external, previous);
  }

  [[nodiscard]] bool outside(const JointVector& q) const {
    return arm_.robot().joint_outside_limits(q).has_value();
  }

  const Program& program_;
  const ArmOfProgram& arm_;
  const CellTools& cell_;
  NominalTargets found_;
  std::set<int> moving_axes_;
  std::map<std::size_t, std::optional<JointVector>> last_;  ///< by file
  std::vector<bool> done_;
  std::vector<std::optional<Stand>> stands_;  ///< behind each motion; empty: not followed yet
  bool changed_ = false, noted_as_said_ = false, noted_beginning_ = false;
};

}  // namespace

std::vector<double> in_degrees(Coordinates coordinates, std::vector<double> axes) {
  if (coordinates == Coordinates::kJointRadians) {
    for (double& axis : axes) axis = to_deg(axis);
  }
  return axes;
}

std::vector<double> in_degrees(const ProgramTarget& target, std::vector<double> axes) {
  for (std::size_t k = 0; k < std::min(axes.size(), target.pulses_per_deg.size()); ++k)
    axes[k] /= target.pulses_per_deg[k];
  return in_degrees(target.coordinates, std::move(axes));
}

Result<NominalTargets> nominal_targets(const Program& program, const ArmOfProgram& arm,
                                       const CellTools& cell, const std::string& tool,
                                       const std::string& payload, BareTools bare) {
  TRY(check_files(program));
  TRY(check_stated_robot(program, arm.robot()));
  TRY(check_gravity(program, cell));
  std::vector<ToolUse> uses(program.tools.size(), ToolUse::kNone);
  for (const ProgramTarget& target : program.targets) {
    const bool joints = bare == BareTools::kOfTheCell && is_joints(target.coordinates);
    ToolUse& use = uses[target.tool];
    if (use != ToolUse::kPoses) use = joints ? ToolUse::kJoints : ToolUse::kPoses;
  }
  std::vector<ToolChoice> choices = TRY(choose_tools(program, uses, cell, tool, payload));
  return Finding(program, arm, cell, std::move(choices)).find();
}

std::optional<Pose> wanted_pose(const Program& program, const Chain& robot, const CellTools& cell,
                                const NominalTargets& nominal, std::size_t t) {
  const ProgramTarget& target = program.targets[t];
  if (!is_joints(target.coordinates))
    return program.frames[target.frame].X_BO * pose_of(target.coordinates, target.numbers);
  if (!nominal.targets[t].q) return std::nullopt;
  return robot.flange_pose(*nominal.targets[t].q) * cell.tools.at(nominal.tools[target.tool].tool);
}

std::vector<TargetGroup> groups_of(const Program& program, const NominalTargets& nominal) {
  std::vector<TargetGroup> groups;
  for (std::size_t t = 0; t < program.targets.size(); ++t) {
    if (!nominal.targets[t].why_not.empty()) continue;
    const ToolChoice& choice = nominal.tools[program.targets[t].tool];
    const auto same = std::find_if(groups.begin(), groups.end(), [&](const TargetGroup& group) {
      return group.tool == choice.tool && group.payload == choice.payload;
    });
    if (same == groups.end())
      groups.push_back({choice.tool, choice.payload, {t}});
    else
      same->targets.push_back(t);
  }
  return groups;
}

}  // namespace trammel::cam
