#include "clients/cam/nominal_targets.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "clients/cam/stated_robot.h"
#include "clients/cam/taught.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

client::PoseMm to_wire(const Pose& X_BT) {
  const Eigen::Quaterniond R(X_BT.linear());
  const Vector3 p = X_BT.translation() * to_mm(1);
  return {p.x(), p.y(), p.z(), R.w(), R.x(), R.y(), R.z()};
}

constexpr double kLargest = 1e7;  // of a target's numbers, mm or deg

class Finding {
 public:
  Finding(const Program& program, const ArmOfProgram& arm, const CellTools& cell, std::vector<ToolChoice> tools)
      : program_(program), arm_(arm), cell_(cell), found_{std::move(tools), {}, {}} {
    found_.targets.resize(program.targets.size());
  }

  NominalTargets find() {
    note_tools();
    find_moving_axes();
    find_joints();
    if (doubts_ > 0)
      found_.notes.push_back(fmt::format(
          "{} targets: what the program says of the configuration contradicts itself; the branch is followed",
          doubts_));
    return std::move(found_);
  }

 private:
  void note_tools() {
    found_.notes = program_.notes;
    for (const std::string& note : notes_on_base(program_, cell_)) found_.notes.push_back(note);
    if (const std::string note = note_on_taught_targets(program_); !note.empty()) found_.notes.push_back(note);
    const auto add = [&](const std::string& note) {
      if (!note.empty() && std::find(found_.notes.begin(), found_.notes.end(), note) == found_.notes.end())
        found_.notes.push_back(note);
    };
    for (const ToolChoice& choice : found_.tools) {
      add(choice.note);
      add(choice.load_note);
    }
  }

  /// External axes that the cell has no rail for: the robot stands still only where they do.
  void find_moving_axes() {
    std::map<int, std::set<double>> values;
    for (const ProgramTarget& target : program_.targets) {
      for (const auto& [axis, value] : target.external) values[axis].insert(value);
    }
    const int rails = arm_.has_rail() ? 1 : 0;
    for (const auto& [axis, seen] : values) {
      if (axis >= rails && seen.size() > 1) moving_axes_.insert(axis);
    }
  }

  void find_joints() {
    // In the order of the motions, since one motion may leave its configuration to the one before.
    std::map<std::size_t, std::optional<JointVector>> last;
    std::vector<bool> done(program_.targets.size(), false);
    const auto one = [&](std::size_t t) {
      std::optional<JointVector>& previous = last[program_.targets[t].file];
      if (!done[t]) find_joints(t, previous);
      done[t] = true;
      if (found_.targets[t].q) previous = found_.targets[t].q;
    };
    for (const ProgramMove& move : program_.moves) {
      for (const std::size_t t : move.targets) one(t);
    }
    for (std::size_t t = 0; t < program_.targets.size(); ++t) {
      if (!done[t]) one(t);
    }
  }

  void find_joints(std::size_t t, const std::optional<JointVector>& previous) {
    const ProgramTarget& target = program_.targets[t];
    const ToolChoice& choice = found_.tools[target.tool];
    if (!choice.why_not.empty()) {
      found_.targets[t].why_not = choice.why_not;
      return;
    }
    for (const auto& [axis, value] : target.external) {
      if (!moving_axes_.contains(axis)) continue;
      found_.targets[t].why_not =
          fmt::format("external axis {} moves, and the cell has none", static_cast<char>('a' + axis));
      return;
    }
    const auto beyond = [](double number) { return !(std::abs(number) < kLargest); };
    if (std::any_of(target.numbers.begin(), target.numbers.end(), beyond)) {
      found_.targets[t].why_not = "a number that no robot reaches";
      return;
    }
    client::TargetMm& asked = found_.targets[t].asked;
    if (is_joints(target.coordinates)) {
      const auto q = arm_.from_axes(in_degrees(target.coordinates, target.numbers), target.external);
      if (!q) {
        found_.targets[t].why_not = "the program does not say where the rail is";
        return;
      }
      asked.joint_target = true;
      asked.seed_rad = joints_on_wire(*q, arm_.robot());
      found_.targets[t].q = *q;
      return;
    }
    const Pose X_BT = program_.frames[target.frame].X_BO * pose_of(target.coordinates, target.numbers);
    asked.pose = to_wire(X_BT);
    const NominalJoints found =
        arm_.joints(X_BT * cell_.tools.at(choice.tool).inverse(), target.configuration, target.external, previous);
    found_.targets[t].doubt = found.doubt;
    if (!found.doubt.empty()) ++doubts_;
    if (found.q) {
      asked.seed_rad = joints_on_wire(*found.q, arm_.robot());
      found_.targets[t].q = *found.q;
      if (outside(*found.q) && found.conf && !arm_.has_rail()) {
        // So that the answer names the branches that would reach it.
        asked.seed_rad.clear();
        asked.conf = found.conf;
      }
    } else if (found.conf && !arm_.has_rail()) {
      asked.conf = found.conf;
    } else {
      found_.targets[t].why_not = found.why_not;
    }
  }

  [[nodiscard]] bool outside(const JointVector& q) const { return arm_.robot().joint_outside_limits(q).has_value(); }

  const Program& program_;
  const ArmOfProgram& arm_;
  const CellTools& cell_;
  NominalTargets found_;
  std::set<int> moving_axes_;
  std::size_t doubts_ = 0;
};

}  // namespace

std::vector<double> joints_on_wire(const JointVector& q, const Chain& robot) {
  std::vector<double> wire;
  for (int j = 0; j < robot.size(); ++j)
    wire.push_back(robot.joint(j).type == JointType::kRevolute ? q(j) : to_mm(q(j)));
  return wire;
}

std::vector<double> in_degrees(Coordinates coordinates, std::vector<double> axes) {
  if (coordinates == Coordinates::kJointRadians) {
    for (double& axis : axes) axis = to_deg(axis);
  }
  return axes;
}

namespace {

/// Readers count lines by LF, and comments end with it.
Status check_line_ends(const Program& program) {
  for (const SourceFile& file : program.files) {
    if (file.text.find('\r') == std::string::npos || file.text.find('\n') != std::string::npos) continue;
    return refused("its lines end in CR alone").in(file.name).next("save it with line ends LF or CR LF");
  }
  return {};
}

}  // namespace

Result<NominalTargets> nominal_targets(const Program& program, const ArmOfProgram& arm, const CellTools& cell,
                                       const std::string& tool, const std::string& payload, BareTools bare) {
  if (const Status lines = check_line_ends(program); !lines) return tl::make_unexpected(lines.error());
  if (const Status same = check_stated_robot(program, arm.robot()); !same) return tl::make_unexpected(same.error());
  std::vector<ToolUse> uses(program.tools.size(), ToolUse::kNone);
  for (const ProgramTarget& target : program.targets) {
    const bool joints = bare == BareTools::kOfTheCell && is_joints(target.coordinates);
    ToolUse& use = uses[target.tool];
    if (use != ToolUse::kPoses) use = joints ? ToolUse::kJoints : ToolUse::kPoses;
  }
  Result<std::vector<ToolChoice>> choices = choose_tools(program, uses, cell, tool, payload);
  if (!choices) return tl::make_unexpected(choices.error());
  return Finding(program, arm, cell, std::move(*choices)).find();
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
