#include "clients/cam/correct_program.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "clients/cam/configuration.h"
#include "clients/cam/edits.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

constexpr double kShareOfSigma = 0.1;        // that rounding may take
constexpr double kLeastRoundingMm = 1e-6;    // no digits beyond
constexpr double kDefaultRoundingMm = 1e-3;  // where no sigma is known
constexpr double kRotationRounding = 1e-6;   // rad: 1 µm at 1 m
constexpr double kReach = 3;                 // m, the lever of a joint
constexpr const char* kSuggestion = "; conf ";

Pose from_wire(const client::PoseMm& pose) {
  const Eigen::Quaterniond R(pose.qw, pose.qx, pose.qy, pose.qz);
  return make_pose(R.normalized().toRotationMatrix(), Vector3(pose.x_mm, pose.y_mm, pose.z_mm) * from_mm(1));
}

client::PoseMm to_wire(const Pose& X_BT) {
  const Eigen::Quaterniond R(X_BT.linear());
  const Vector3 p = X_BT.translation() * to_mm(1);
  return {p.x(), p.y(), p.z(), R.w(), R.x(), R.y(), R.z()};
}

/// rad, of a rail mm.
std::vector<double> to_wire(const JointVector& q, const Chain& robot) {
  std::vector<double> wire;
  for (int j = 0; j < robot.size(); ++j)
    wire.push_back(robot.joint(j).type == JointType::kRevolute ? q(j) : to_mm(q(j)));
  return wire;
}

JointVector from_wire(const std::vector<double>& wire, const Chain& robot) {
  JointVector q(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const double value = wire[static_cast<std::size_t>(j)];
    q(j) = robot.joint(j).type == JointType::kRevolute ? value : from_mm(value);
  }
  return q;
}

std::vector<double> in_degrees(Coordinates coordinates, std::vector<double> axes) {
  if (coordinates == Coordinates::kJointRadians) {
    for (double& axis : axes) axis = to_deg(axis);
  }
  return axes;
}
/// Of degrees.
std::vector<double> axes_of(Coordinates coordinates, std::vector<double> axes) {
  if (coordinates == Coordinates::kJointRadians) {
    for (double& axis : axes) axis = from_deg(axis);
  }
  return axes;
}

/// Targets of one tool and payload of the cell, asked for together.
struct Group {
  std::string tool, payload;
  std::vector<std::size_t> targets;
};

class Correcting {
 public:
  Correcting(const Program& program, const Chain& robot, const CellTools& cell, const CorrectProgramOptions& options)
      : program_(program),
        arm_(robot),
        cell_(cell),
        options_(options),
        asked_(program.targets.size()),
        why_not_(program.targets.size()),
        rows_(program.targets.size()) {}

  Result<CorrectedProgram> correct(const AskCorrections& ask) {
    if (const Status fresh = check_marks(); !fresh) return tl::make_unexpected(fresh.error());
    std::vector<bool> used(program_.tools.size(), false);
    for (const ProgramTarget& target : program_.targets) used[target.tool] = true;
    Result<std::vector<ToolChoice>> choices = choose_tools(program_, used, cell_, options_.tool, options_.payload);
    if (!choices) return tl::make_unexpected(choices.error());
    choices_ = std::move(*choices);
    note_tools();
    find_moving_axes();
    find_joints();
    edits_.resize(program_.files.size());
    for (std::size_t t = 0; t < program_.targets.size(); ++t) begin_row(t);
    if (const Status answered = ask_all(ask); !answered) return tl::make_unexpected(answered.error());
    return finish();
  }

 private:
  [[nodiscard]] Status check_marks() const {
    for (const SourceFile& file : program_.files) {
      const auto mark = find_mark(file.text);
      if (!mark) continue;
      return refused("it is corrected already, by model {} on {}", shown_short(mark->model), shown_short(mark->date))
          .in(file.name)
          .next("correct the original, or --again takes the one that is kept beside it");
    }
    return {};
  }

  void note_tools() {
    for (const ToolChoice& choice : choices_) {
      if (!choice.note.empty()) result_.notes.push_back(choice.note);
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
      if (joints_of_.contains(t)) previous = joints_of_[t];
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
    const ToolChoice& choice = choices_[target.tool];
    if (!choice.why_not.empty()) {
      why_not_[t] = choice.why_not;
      return;
    }
    for (const auto& [axis, value] : target.external) {
      if (!moving_axes_.contains(axis)) continue;
      why_not_[t] = fmt::format("external axis {} moves, and the cell has none", static_cast<char>('a' + axis));
      return;
    }
    client::TargetMm& asked = asked_[t];
    if (is_joints(target.coordinates)) {
      const auto q = arm_.from_axes(in_degrees(target.coordinates, target.numbers), target.external);
      if (!q) {
        why_not_[t] = "the program does not say where the rail is";
        return;
      }
      asked.joint_target = true;
      asked.seed_rad = to_wire(*q, arm_.robot());
      joints_of_[t] = *q;
      return;
    }
    const Pose X_BT = program_.frames[target.frame].X_BO * pose_of(target.coordinates, target.numbers);
    asked.pose = to_wire(X_BT);
    const NominalJoints found =
        arm_.joints(X_BT * cell_.tools.at(choice.tool).inverse(), target.configuration, target.external, previous);
    if (found.q) {
      asked.seed_rad = to_wire(*found.q, arm_.robot());
      joints_of_[t] = *found.q;
      if (outside(*found.q) && found.conf && !arm_.has_rail()) {
        // So that the answer names the branches that would reach it.
        asked.seed_rad.clear();
        asked.conf = found.conf;
      }
    } else if (found.conf && !arm_.has_rail()) {
      asked.conf = found.conf;
    } else {
      why_not_[t] = found.why_not;
    }
  }

  [[nodiscard]] bool outside(const JointVector& q) const { return arm_.robot().joint_outside_limits(q).has_value(); }

  void begin_row(std::size_t t) {
    const ProgramTarget& target = program_.targets[t];
    ReceiptRow& row = rows_[t];
    row.name = target.name;
    row.file = program_.files[target.file].name;
    row.line = target.line;
    row.motion = target.motion;
    row.used_at = target.used_at;
    row.tool = program_.tools[target.tool].name;
    row.frame = program_.frames[target.frame].name;
    row.coordinates = target.coordinates;
    row.before = target.numbers;
    row.folded = target.folded;
    row.status = "refused";
    row.message = why_not_[t];
    if (is_joints(target.coordinates) && joints_of_.contains(t)) {
      const Pose X_FT = cell_.tools.at(choices_[target.tool].tool);
      row.p_B = (arm_.robot().flange_pose(joints_of_[t]) * X_FT).translation();
    }
    if (!is_joints(target.coordinates))
      row.p_B = program_.frames[target.frame].X_BO * pose_of(target.coordinates, target.numbers).translation();
  }

  Status ask_all(const AskCorrections& ask) {
    std::vector<Group> groups;
    for (std::size_t t = 0; t < program_.targets.size(); ++t) {
      if (!why_not_[t].empty()) continue;
      const ToolChoice& choice = choices_[program_.targets[t].tool];
      const auto same = std::find_if(groups.begin(), groups.end(), [&](const Group& group) {
        return group.tool == choice.tool && group.payload == choice.payload;
      });
      if (same == groups.end())
        groups.push_back({choice.tool, choice.payload, {t}});
      else
        same->targets.push_back(t);
    }
    for (const Group& group : groups) {
      std::vector<client::TargetMm> targets;
      for (const std::size_t t : group.targets) targets.push_back(asked_[t]);
      const Result<client::Answer<client::CorrectedTarget>> answer = ask(group.tool, group.payload, targets);
      if (!answer) return tl::make_unexpected(answer.error());
      if (!result_.model_id.empty() && result_.model.hash != answer->model.hash)
        return failure(ErrorCode::kBusy, "the model changed while the program was corrected").next("try again");
      result_.model = answer->model;
      result_.model_id = answer->model.id;
      for (std::size_t k = 0; k < group.targets.size(); ++k) take(group.targets[k], answer->items[k]);
    }
    return {};
  }

  void take(std::size_t t, const client::CorrectedTarget& item) {
    const ProgramTarget& target = program_.targets[t];
    ReceiptRow& row = rows_[t];
    row.status = item.status;
    row.message = item.message;
    if (const std::size_t at = row.message.find(kSuggestion); at != std::string::npos) {
      row.suggestion = row.message.substr(at + 2);
      row.message.erase(at);
    }
    row.error_before_mm = item.error_before_mm;
    row.error_after_mm = item.error_after_mm;
    row.sigma_mm = item.sigma_mm;
    row.sigma_measured_mm = item.sigma_measured_mm;
    row.iterations = item.iterations;
    if (item.status != "ok" && item.status != "out_of_domain") return;
    const Pose X_BT = from_wire(item.commanded);
    const Pose X_TF = cell_.tools.at(choices_[target.tool].tool).inverse();
    JointVector q = from_wire(item.q_rad, arm_.robot());
    if (arm_.has_rail() && joints_of_.contains(t)) {
      // The rail stays where the program has it.
      JointVector seed = joints_of_[t];
      q = arm_.near(X_BT * X_TF, seed);
    }
    row.joints = to_wire(q, arm_.robot());
    for (int j = 0; j < q.size(); ++j) {
      if (arm_.robot().joint(j).type == JointType::kRevolute) row.joints[static_cast<std::size_t>(j)] = to_deg(q(j));
    }
    const std::vector<double> exact =
        is_joints(target.coordinates)
            ? axes_of(target.coordinates, arm_.to_axes(q))
            : numbers_of(target.coordinates, program_.frames[target.frame].X_BO.inverse() * X_BT, target.numbers);
    write(target, exact, row);
    row.rounding_mm = rounding(target, exact, row.after, q, X_TF);
    row.error_after_mm = std::hypot(row.error_after_mm, row.rounding_mm);
  }

  /// In the unit of the number.
  [[nodiscard]] double largest_rounding(const ProgramTarget& target, std::size_t value, double sigma_mm) const {
    const double mm = std::isfinite(sigma_mm) && sigma_mm > 0 ? std::max(kShareOfSigma * sigma_mm, kLeastRoundingMm)
                                                              : kDefaultRoundingMm;
    switch (target.coordinates) {
      case Coordinates::kJoints:
        return to_deg(from_mm(mm) / kReach);
      case Coordinates::kJointRadians:
        return from_mm(mm) / kReach;
      case Coordinates::kRotationVector:
        return value < 3 ? from_mm(mm) : kRotationRounding;
      case Coordinates::kQuaternion:
        return value < 3 ? mm : kRotationRounding / 2;
      default:
        return value < 3 ? mm : to_deg(kRotationRounding);
    }
  }

  void write(const ProgramTarget& target, const std::vector<double>& exact, ReceiptRow& row) {
    row.after = target.numbers;
    for (const Rewrite& rewrite : target.rewrites) {
      std::string text = rewrite.texts.empty() ? "" : rewrite.texts[0];
      for (std::size_t k = 0; k < rewrite.slots.size(); ++k) {
        const Slot& slot = rewrite.slots[k];
        const double value = exact[slot.value];
        const NumberStyle style =
            options_.keep_digits ? slot.style
                                 : with_rounding(value, slot.style, largest_rounding(target, slot.value, row.sigma_mm));
        const std::string number = number_text(value, style);
        if (const auto written = read_number(number)) row.after[slot.value] = written->value;
        text += number;
        if (!rewrite.texts.empty()) text += rewrite.texts[k + 1];
      }
      edits_[target.file].replace(rewrite.span, std::move(text));
    }
    if (!target.comment.empty()) edits_[target.file].insert_line(target.comment_at, target.comment);
  }

  /// mm, of the tool.
  [[nodiscard]] double rounding(const ProgramTarget& target, const std::vector<double>& exact,
                                const std::vector<double>& written, const JointVector& q, const Pose& X_TF) const {
    if (!is_joints(target.coordinates)) {
      return to_mm(
          (pose_of(target.coordinates, written).translation() - pose_of(target.coordinates, exact).translation())
              .norm());
    }
    const auto rounded = arm_.from_axes(in_degrees(target.coordinates, written), target.external);
    if (!rounded) return 0;
    const Pose X_FT = X_TF.inverse();
    return to_mm(
        ((arm_.robot().flange_pose(*rounded) * X_FT).translation() - (arm_.robot().flange_pose(q) * X_FT).translation())
            .norm());
  }

  CorrectedProgram finish() {
    result_.moves = program_.moves.size();
    for (std::size_t m = program_.moves.size(); m-- > 0;) {
      for (const std::size_t t : program_.moves[m].targets) rows_[t].order = m;
    }
    for (const ProgramMove& move : program_.moves) {
      const bool corrected = !move.targets.empty() && std::all_of(move.targets.begin(), move.targets.end(),
                                                                  [&](std::size_t t) { return rows_[t].corrected(); });
      if (corrected) ++result_.moves_corrected;
    }
    for (ReceiptRow& row : rows_) result_.rows.push_back(std::move(row));
    for (const LeftAlone& left : program_.left) {
      ReceiptRow& row = result_.rows.emplace_back();
      row.name = left.name;
      row.file = program_.files[left.file].name;
      row.line = left.line;
      row.motion = left.motion;
      row.status = "refused";
      row.message = left.why;
    }
    std::stable_sort(result_.rows.begin(), result_.rows.end(), [](const ReceiptRow& a, const ReceiptRow& b) {
      return std::tie(a.file, a.line) < std::tie(b.file, b.line);
    });
    for (std::size_t f = 0; f < program_.files.size(); ++f) write_file(f);
    return std::move(result_);
  }

  void write_file(std::size_t f) {
    const SourceFile& file = program_.files[f];
    result_.changed.push_back(!edits_[f].empty());
    if (edits_[f].empty()) {
      result_.files.push_back(file);
      return;
    }
    const MarkPlace& place = program_.mark_places[f];
    const std::vector<std::string> words =
        words_of({result_.model_id, options_.version, options_.date, short_hash(file.text)});
    if (place.a_line_each) {
      for (const std::string& word : words) edits_[f].insert_line(place.at, place.begin + word + place.end);
    } else {
      edits_[f].insert_line(place.at, fmt::format("{}{}{}", place.begin, fmt::join(words, " "), place.end));
    }
    Edits::Applied applied = edits_[f].apply(file.text);
    for (Edits::Applied::Line& line : applied.inserted)
      result_.inserted.push_back({file.name, line.number, std::move(line.text)});
    result_.files.push_back({file.name, std::move(applied.text)});
  }

  const Program& program_;
  const ArmOfProgram arm_;
  const CellTools& cell_;
  const CorrectProgramOptions& options_;
  std::vector<ToolChoice> choices_;
  std::vector<client::TargetMm> asked_;
  std::vector<std::string> why_not_;  ///< of each target; empty: asked
  std::vector<ReceiptRow> rows_;
  std::map<std::size_t, JointVector> joints_of_;
  std::set<int> moving_axes_;
  std::vector<Edits> edits_;
  CorrectedProgram result_;
};

}  // namespace

std::size_t CorrectedProgram::left_alone() const {
  return static_cast<std::size_t>(
      std::count_if(rows.begin(), rows.end(), [](const ReceiptRow& row) { return !row.corrected(); }));
}

Result<CorrectedProgram> correct_program(const Program& program, const Chain& robot, const CellTools& cell,
                                         const AskCorrections& ask, const CorrectProgramOptions& options) {
  return Correcting(program, robot, cell, options).correct(ask);
}

}  // namespace trammel::cam
