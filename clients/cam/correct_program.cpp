#include "clients/cam/correct_program.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "clients/cam/configuration.h"
#include "clients/cam/edits.h"
#include "clients/cam/flow.h"
#include "clients/cam/free_turns.h"
#include "clients/cam/nominal_targets.h"
#include "clients/cam/path_check.h"
#include "clients/cam/short_names.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/exchange/si.h"
#include "server/robot/branch_hint.h"

namespace trammel::cam {

namespace {

constexpr double kShareOfSigma = 0.1;        // share of sigma that rounding may take
constexpr double kLeastRoundingMm = 1e-6;    // no digits beyond
constexpr double kDefaultRoundingMm = 1e-3;  // if no sigma is known
constexpr double kRotationRounding = 1e-6;   // rad: 1 µm at 1 m
constexpr double kReach = 3;                 // m, the lever of a joint
constexpr double kAlongTheAxis = 0.02;       // of a way, off the tool's axis

/// The axes in the target's own units; `axes`: degrees.
std::vector<double> axes_of(const ProgramTarget& target, std::vector<double> axes) {
  if (target.coordinates == Coordinates::kJointRadians) {
    for (double& axis : axes) axis = from_deg(axis);
  }
  for (std::size_t k = 0; k < std::min(axes.size(), target.pulses_per_deg.size()); ++k)
    axes[k] *= target.pulses_per_deg[k];
  return axes;
}

Status check_marks(const Program& program) {
  for (const SourceFile& file : program.files) {
    const auto mark = find_mark(file.text);
    if (!mark) continue;
    return refused("{}", mark_text(*mark))
        .in(file.name)
        .next("correct the original, or --again takes the one that is kept beside it");
  }
  return {};
}

class Correcting {
 public:
  Correcting(const Program& program, const ArmOfProgram& arm, const CellTools& cell,
             const CorrectProgramOptions& options, NominalTargets nominal, const Program& original,
             const std::vector<double>& turned_deg)
      : program_(program),
        original_(original),
        turned_deg_(turned_deg),
        arm_(arm),
        cell_(cell),
        options_(options),
        nominal_(std::move(nominal)),
        rows_(program.targets.size()),
        moves_to_(program.targets.size()) {
    result_.notes = nominal_.notes;
    result_.contradictions = nominal_.contradictions;
    for (const ProgramMove& move : program_.moves) {
      for (const std::size_t t : move.targets) {
        if (options_.lead_in) moves_to_[t].push_back(&move);
      }
    }
    if (options_.lead_in && options_.lead_in->take_ups.empty())
      result_.notes.emplace_back(
          "the model knows of no play and no hysteresis: no approach point is needed");
  }

  Result<CorrectedProgram> correct(const AskCorrections& ask) {
    edits_.resize(program_.files.size());
    for (std::size_t t = 0; t < program_.targets.size(); ++t) begin_row(t);
    TRY(ask_all(ask));
    return finish();
  }

 private:
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
    row.before = original_.targets[t].numbers;
    if (!turned_deg_.empty()) row.turned_deg = turned_deg_[t];
    row.folded = target.folded;
    row.status = "refused";
    row.message = nominal_.targets[t].why_not;
    if (const auto X_BT = wanted_pose(program_, arm_.robot(), cell_, nominal_, t))
      row.p_B = X_BT->translation();
  }

  Status ask_all(const AskCorrections& ask) {
    for (const TargetGroup& group : groups_of(program_, nominal_)) {
      std::vector<exchange::AskedTarget> targets;
      for (const std::size_t t : group.targets)
        targets.push_back(std::move(nominal_.targets[t].asked));
      exchange::Answer<exchange::CorrectedTarget> answer =
          TRY(ask(group.tool, group.payload, targets));
      TRY(note_model(answer.model));
      if (options_.lead_in) TRY(find_lead_ins(group, targets, ask, answer.items));
      targets = {};
      for (std::size_t k = 0; k < group.targets.size(); ++k)
        take(group.targets[k], answer.items[k]);
    }
    return {};
  }

  Status note_model(const exchange::ModelInfo& model) {
    if (!result_.model_id.empty() && result_.model.hash != model.hash)
      return failure(ErrorCode::kBusy, "the model changed while the program was corrected")
          .next("try again");
    result_.model = model;
    result_.model_id = model.id;
    return {};
  }

  Status find_lead_ins(const TargetGroup& group, const std::vector<exchange::AskedTarget>& targets,
                       const AskCorrections& ask, std::vector<exchange::CorrectedTarget>& items) {
    const AskTargets ask_again = [&](const std::vector<exchange::AskedTarget>& led)
        -> Result<std::vector<exchange::CorrectedTarget>> {
      auto answer = TRY(ask(group.tool, group.payload, led));
      TRY(note_model(answer.model));
      return std::move(answer.items);
    };
    const FindWay find_way = [&](std::size_t k, const exchange::CorrectedTarget& item) {
      return way_to(group.targets[k], item);
    };
    std::vector<LeadInFound> found =
        TRY(lead_in_where_needed(*options_.lead_in, targets, ask_again, find_way, items));
    for (std::size_t k = 0; k < found.size(); ++k)
      lead_ins_.emplace(group.targets[k], std::move(found[k]));
    return {};
  }

  /// The lead-in to a target, or the reason why there is none.
  [[nodiscard]] LeadInFound way_to(std::size_t t, const exchange::CorrectedTarget& item) const {
    if (arm_.has_rail()) return {{}, "the arm stands on a rail"};
    double back_off = kBackOff;
    for (const ProgramMove* move : moves_to_[t]) {
      if (move->another.empty() || move->targets.size() != 1)
        return {{},
                fmt::format("the motion to it (line {}) does not stop there, or is none that could "
                            "be written once more",
                            move->line)};
      back_off = std::max(back_off, own_way_along_the_axis(*move, t));
    }
    const Chain& robot = arm_.robot();
    const JointVector q = exchange::si_from_degrees(item.joints_deg, robot);
    const Pose X_FT = cell_.tools.at(nominal_.tools[program_.targets[t].tool].tool);
    auto way = lead_in(robot, q, X_FT, options_.lead_in->take_ups, back_off);
    if (!way) return {{}, "a limit or a singular place is in the way"};
    for (const JointVector& offset : way->offsets) {
      if (!keeps_configuration(program_.targets[t].configuration, arm_.to_axes(q),
                               arm_.to_axes(q + offset), kNextQuarter))
        return {{}, "a joint would leave the configuration that the program says"};
    }
    return {std::move(way), ""};
  }

  /// m: how far the motion itself comes along the tool's axis, from the one above it or those that
  /// may come before it; 0 where it comes otherwise.
  [[nodiscard]] double own_way_along_the_axis(const ProgramMove& move, std::size_t t) const {
    const auto X_BT = wanted_pose(program_, arm_.robot(), cell_, nominal_, t);
    if (!X_BT || !program_.targets[t].linear) return 0;
    std::set<std::size_t> before = move.before;
    if (const ProgramMove* first = program_.moves.data();
        &move != first && (&move)[-1].file == move.file)
      before.insert(static_cast<std::size_t>(&move - first) - 1);
    double longest = 0;
    for (const std::size_t m : before) {
      if (m == kNoMotion || program_.moves[m].targets.size() != 1) continue;
      const auto X_BP =
          wanted_pose(program_, arm_.robot(), cell_, nominal_, program_.moves[m].targets[0]);
      if (!X_BP) continue;
      const Vector3 p_TP = X_BT->inverse() * X_BP->translation();
      if (p_TP.z() < 0 && p_TP.head<2>().norm() < kAlongTheAxis * p_TP.norm())
        longest = std::max(longest, p_TP.norm());
    }
    return longest;
  }

  /// The points of a lead-in, before each motion to the target.
  void write_lead_in(std::size_t t, const JointVector& q, const Pose& X_FT, ReceiptRow& row) {
    const auto found = lead_ins_.find(t);
    if (found == lead_ins_.end()) return;
    tell_no_lead_in(found->second, row.message);
    if (!found->second.way) return;
    row.lead_in = static_cast<int>(found->second.way->offsets.size());
    for (const ProgramMove* move : moves_to_[t]) {
      for (const JointVector& offset : found->second.way->offsets)
        write_another(*move, program_.targets[t], q + offset, X_FT, row.sigma_mm);
    }
  }

  void write_another(const ProgramMove& move, const ProgramTarget& target, const JointVector& q,
                     const Pose& X_FT, double sigma_mm) {
    const std::vector<double> numbers = numbers_at(target, q, X_FT);
    ++result_.lead_ins;
    std::string number;
    if (move.file < program_.points.size()) {
      const PointList& list = program_.points[move.file];
      number = fmt::format("{:0{}}", list.next + new_points_[move.file]++, list.width);
    }
    for (const NewLine& line : move.another) {
      std::string text = line.texts[0];
      for (std::size_t k = 0; k < line.slots.size(); ++k) {
        const Slot& slot = line.slots[k];
        const double value = numbers[slot.value];
        text += number_text(value, fine_style(target, slot, value, sigma_mm)) + line.texts[k + 1];
      }
      if (const std::size_t at = text.find(kNewPoint); at != std::string::npos)
        text.replace(at, 1, number);
      edits_[move.file].insert_line(line.at, std::move(text));
    }
  }

  /// The number of points that a file has now.
  void write_counts() {
    for (const auto& [file, more] : new_points_) {
      const PointList& list = program_.points[file];
      if (list.count.end > 0)
        edits_[file].replace(list.count, fmt::format("{}", list.counted + more));
    }
  }

  /// Joints in the coordinates of a target.
  [[nodiscard]] std::vector<double> numbers_at(const ProgramTarget& target, const JointVector& q,
                                               const Pose& X_FT) const {
    if (is_joints(target.coordinates)) return axes_of(target, arm_.to_axes(q));
    const Pose X_BT = arm_.robot().flange_pose(q) * X_FT;
    return numbers_of(target.coordinates, program_.frames[target.frame].X_BO.inverse() * X_BT,
                      target.numbers);
  }

  void take(std::size_t t, const exchange::CorrectedTarget& item) {
    const ProgramTarget& target = program_.targets[t];
    ReceiptRow& row = rows_[t];
    row.status = item.status;
    row.message = item.message;
    if (const BranchHint hint = branch_hint_in(item.message); !hint.branches.empty()) {
      row.message = hint.before;
      row.suggestion = fmt::format("{} would reach it", branch_list(hint.branches));
    }
    if (const std::string& doubt = nominal_.targets[t].doubt; !doubt.empty())
      row.message += row.message.empty() ? doubt : "; " + doubt;
    row.error_before_mm = item.error_before_mm;
    row.error_after_mm = item.error_after_mm;
    row.sigma_mm = item.sigma_mm;
    row.sigma_measured_mm = item.sigma_measured_mm;
    row.iterations = item.iterations;
    if (!is_answered(item)) return;
    const Pose X_BT = exchange::to_si(item.commanded);
    const Pose X_TF = cell_.tools.at(nominal_.tools[target.tool].tool).inverse();
    JointVector q = exchange::si_from_degrees(item.joints_deg, arm_.robot());
    // The rail keeps the program's position.
    row.joints = item.joints_deg;
    if (const auto& nominal = nominal_.targets[t].q; arm_.has_rail() && nominal) {
      q = arm_.near(X_BT * X_TF, *nominal);
      row.joints = exchange::degrees_from_si(q, exchange::rails_of(arm_.robot()));
    }
    const std::vector<double> exact =
        is_joints(target.coordinates)
            ? axes_of(target, arm_.to_axes(q))
            : numbers_of(target.coordinates, program_.frames[target.frame].X_BO.inverse() * X_BT,
                         target.numbers);
    if (!std::all_of(exact.begin(), exact.end(),
                     [](double number) { return std::isfinite(number); })) {
      row.status = "refused";
      row.message = "what is to be commanded is no number";
      row.joints.clear();
      return;
    }
    row.correction_B = X_BT.translation() - row.p_B;
    write(target, exact, row);
    row.rounding_mm = rounding(target, exact, row.after, q, X_TF);
    row.error_after_mm = std::hypot(row.error_after_mm, row.rounding_mm);
    write_lead_in(t, q, X_TF.inverse(), row);
  }

  /// In the unit of the number.
  [[nodiscard]] double largest_rounding(const ProgramTarget& target, std::size_t value,
                                        double sigma_mm) const {
    const double mm = std::isfinite(sigma_mm) && sigma_mm > 0
                          ? std::max(kShareOfSigma * sigma_mm, kLeastRoundingMm)
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

  /// The style of the slot with as many digits as the target is worth.
  [[nodiscard]] NumberStyle fine_style(const ProgramTarget& target, const Slot& slot, double value,
                                       double sigma_mm) const {
    if (target.coordinates == Coordinates::kJointPulses) return slot.style;
    return with_rounding(value, slot.style, largest_rounding(target, slot.value, sigma_mm));
  }

  void write(const ProgramTarget& target, const std::vector<double>& exact, ReceiptRow& row) {
    row.after = target.numbers;
    for (const Rewrite& rewrite : target.rewrites) {
      std::string text = rewrite.texts.empty() ? "" : rewrite.texts[0];
      for (std::size_t k = 0; k < rewrite.slots.size(); ++k) {
        const Slot& slot = rewrite.slots[k];
        const double value = exact[slot.value];
        const NumberStyle style =
            options_.keep_digits ? slot.style : fine_style(target, slot, value, row.sigma_mm);
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
                                const std::vector<double>& written, const JointVector& q,
                                const Pose& X_TF) const {
    if (!is_joints(target.coordinates)) {
      return to_mm((pose_of(target.coordinates, written).translation() -
                    pose_of(target.coordinates, exact).translation())
                       .norm());
    }
    const auto rounded = arm_.from_axes(in_degrees(target, written), target.external);
    if (!rounded) return 0;
    const Pose X_FT = X_TF.inverse();
    return to_mm(((arm_.robot().flange_pose(*rounded) * X_FT).translation() -
                  (arm_.robot().flange_pose(q) * X_FT).translation())
                     .norm());
  }

  CorrectedProgram finish() {
    result_.moves = program_.moves.size();
    for (std::size_t m = program_.moves.size(); m-- > 0;) {
      for (const std::size_t t : program_.moves[m].targets) rows_[t].order = m;
    }
    for (const ProgramMove& move : program_.moves) {
      const bool corrected =
          !move.targets.empty() && std::all_of(move.targets.begin(), move.targets.end(),
                                               [&](std::size_t t) { return rows_[t].corrected(); });
      if (corrected) ++result_.moves_corrected;
    }
    check_path(program_, arm_.robot(), nominal_, rows_, result_);
    result_.rows = std::move(rows_);
    for (const LeftAlone& left : program_.left) {
      if (left.motion.empty())
        continue;  // no motion goes to it: nominal_targets() has a note of it
      ReceiptRow& row = result_.rows.emplace_back();
      row.name = left.name;
      row.file = program_.files[left.file].name;
      row.line = left.line;
      row.motion = left.motion;
      row.status = "refused";
      row.message = left.why;
    }
    tell_readings();
    tell_stored();
    const auto by_place = [](const ReceiptRow& a, const ReceiptRow& b) {
      return std::tie(a.file, a.line) < std::tie(b.file, b.line);
    };
    // Rows are large, and most rows of a long program are already in their places.
    if (!std::is_sorted(result_.rows.begin(), result_.rows.end(), by_place))
      std::stable_sort(result_.rows.begin(), result_.rows.end(), by_place);
    shorten_names(result_.rows);
    write_counts();
    for (std::size_t f = 0; f < program_.files.size(); ++f) write_file(f);
    return std::move(result_);
  }

  /// Reports positions that stay unchanged in the program and move nevertheless, since they are
  /// computed from a corrected target.
  void tell_readings() {
    if (program_.readings.empty()) return;
    std::set<std::pair<std::size_t, std::size_t>> written;
    for (std::size_t t = 0; t < program_.targets.size(); ++t) {
      if (!result_.rows[t].corrected()) continue;
      for (const Rewrite& rewrite : program_.targets[t].rewrites)
        written.emplace(program_.targets[t].file, rewrite.span.begin);
    }
    std::multimap<std::pair<std::string, int>, std::size_t> by_line;
    std::multimap<std::string, std::size_t> by_name;
    for (std::size_t r = program_.targets.size(); r < result_.rows.size(); ++r) {
      by_name.emplace(result_.rows[r].name, r);
      if (!result_.rows[r].motion.empty())
        by_line.emplace(std::pair(result_.rows[r].file, result_.rows[r].line), r);
    }
    std::set<std::string> said;
    std::set<std::pair<std::size_t, std::string>> told;  // rows, and the targets with which they
                                                         // move
    for (const Reading& reading : program_.readings) {
      const auto first = written.lower_bound({reading.file, reading.of.begin});
      if (first == written.end() || first->first != reading.file || first->second >= reading.of.end)
        continue;
      const std::string& by_file = program_.files[reading.by_file].name;
      bool found = reading.motion;
      const auto tell = [&](auto rows) {
        for (auto row = rows.first; row != rows.second; ++row) {
          if (told.insert({row->second, reading.name}).second)
            tell_along(result_.rows[row->second], reading.name);
          found = true;
        }
      };
      tell(by_line.equal_range({by_file, reading.by_line}));
      if (!reading.by.empty()) tell(by_name.equal_range(reading.by));
      const std::string note =
          fmt::format("{} line {} reads {}, which is corrected: what it makes of it moves with it",
                      by_file, reading.by_line, shown(reading.name));
      if (!found && said.insert(note).second) result_.notes.push_back(note);
    }
  }

  static void tell_along(ReceiptRow& row, const std::string& with) {
    row.moves_along = true;
    row.message += fmt::format("; it moves with {}, which is corrected", shown(with));
  }

  /// Reports uncorrected motions to a stored target that is corrected for another motion.
  void tell_stored() {
    const auto is_name = [](const std::string& text) {
      return !text.empty() && text.find_first_of(" ,(:") == std::string::npos && text[0] != '[' &&
             text[0] != '{';
    };
    std::set<std::pair<std::string, std::string>> corrected;
    const auto key = [&](const ReceiptRow& row) {
      const bool shared = program_.dialect == "rapid" || program_.dialect == "krl";
      return std::pair(shared ? std::string() : row.file, row.name);
    };
    if (program_.left.empty()) return;
    for (std::size_t t = 0; t < program_.targets.size(); ++t) {
      if (result_.rows[t].corrected() && is_name(result_.rows[t].name))
        corrected.insert(key(result_.rows[t]));
    }
    for (std::size_t r = program_.targets.size(); r < result_.rows.size(); ++r) {
      ReceiptRow& row = result_.rows[r];
      if (!row.motion.empty() && corrected.contains(key(row)) && !row.moves_along)
        tell_along(row, row.name);
    }
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
      for (const std::string& word : words)
        edits_[f].insert_line(place.at, place.begin + word + place.end);
    } else {
      edits_[f].insert_line(place.at,
                            fmt::format("{}{}{}", place.begin, fmt::join(words, " "), place.end));
    }
    Edits::Applied applied = std::move(edits_[f]).apply(file.text);
    for (Edits::Applied::Line& line : applied.inserted)
      result_.inserted.push_back({file.name, line.number, std::move(line.text)});
    result_.files.push_back({file.name, std::move(applied.text)});
  }

  const Program& program_;
  const Program& original_;  ///< in the state before the poses were turned
  const std::vector<double>& turned_deg_;
  const ArmOfProgram& arm_;
  const CellTools& cell_;
  const CorrectProgramOptions& options_;
  NominalTargets nominal_;
  std::vector<ReceiptRow> rows_;
  std::vector<Edits> edits_;
  std::vector<std::vector<const ProgramMove*>> moves_to_;  ///< by target
  std::map<std::size_t, LeadInFound> lead_ins_;            ///< by target
  std::map<std::size_t, std::size_t> new_points_;          ///< by file
  CorrectedProgram result_;
};

}  // namespace

std::size_t CorrectedProgram::left_alone() const {
  return static_cast<std::size_t>(std::count_if(
      rows.begin(), rows.end(), [](const ReceiptRow& row) { return !row.corrected(); }));
}

Result<CorrectedProgram> correct_program(const Program& program, const Chain& robot,
                                         const CellTools& cell, const AskCorrections& ask,
                                         const CorrectProgramOptions& options) {
  TRY(check_marks(program));
  const ArmOfProgram arm(robot);
  FreeTurns turned;
  if (options.free_rz) {
    FreeTurns found = TRY(turn_freely(program, arm, cell, ask, options.tool, options.payload));
    turned = std::move(found);
  }
  const Program& wanted = options.free_rz ? turned.program : program;
  NominalTargets nominal = TRY(nominal_targets(wanted, arm, cell, options.tool, options.payload));
  return Correcting(wanted, arm, cell, options, std::move(nominal), program, turned.deg)
      .correct(ask);
}

}  // namespace trammel::cam
