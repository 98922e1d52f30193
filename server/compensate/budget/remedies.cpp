#include "server/compensate/budget/remedies.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "server/base/letters.h"
#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/compensate/budget/items.h"
#include "server/error_sources/catalogue.h"

namespace trammel {

namespace {

struct Maker {
  std::string_view begins;  ///< of the robot's name, in lower case
  MakersWords words;
};

const std::vector<Maker>& makers() {
  static const std::vector<Maker> all = {
      {"abb",
       {"ABB",
        "calibration offset of the axis (Calibration > Edit Motor Calibration Offset), then update "
        "the revolution counters",
        "not in the controller, but by ABB's Absolute Accuracy",
        "tooldata: mass, cog; LoadIdentify",
        {"axis 1", "axis 2", "axis 3", "axis 4", "axis 5", "axis 6"}}},
      {"kuka",
       {"KUKA",
        "mastering of the axis (Start-up > Master), with the offset for the tool",
        "$machine.dat, by KUKA's service alone",
        "Load data of the tool ($LOAD): M, X, Y, Z",
        {"A1", "A2", "A3", "A4", "A5", "A6"}}},
      {"fanuc",
       {"FANUC",
        "MENU > SYSTEM > Master/Cal, single-axis mastering ($DMR_GRP.$MASTER_COUN), then CALIBRATE",
        "not in the controller, but by iRCalibration",
        "MOTION PAYLOAD SET ($PLST_GRP)",
        {"J1", "J2", "J3", "J4", "J5", "J6"}}},
      {"yaskawa",
       {"Yaskawa",
        "HOME POSITION of the axis (ROBOT > HOME POSITION)",
        "not in the controller",
        "TOOL: W, Xg, Yg, Zg; W.GRAV.POS measurement",
        {"S", "L", "U", "R", "B", "T"}}},
      {"universal robots",
       {"Universal Robots",
        "calibration.conf: delta_theta of the joint (the file counts in rad, 1 deg is 0.0174533), "
        "or joint zeroing in Expert Mode",
        "calibration.conf: delta_a, delta_d, delta_alpha",
        "Payload: mass and centre of gravity (set_target_payload)",
        {"Base", "Shoulder", "Elbow", "Wrist 1", "Wrist 2", "Wrist 3"}}},
      {"staubli",
       {"Staubli", "recovery of the zero (Adjust), dpsRef of the axis",
        "arm.cfx, by the maker's service alone", "load of the tool"}},
  };
  return all;
}

/// `joint 4 (A4)`.
std::string joint_and_axis(int joint, const MakersWords& words) {
  const std::string plain = fmt::format("joint {}", joint + 1), axis = words.axis(joint);
  return axis == plain ? plain : fmt::format("{} ({})", plain, axis);
}

bool lost_a_zero(const BudgetLine& line) {
  const CauseRecord* cause = find_cause(line.cause);
  return cause != nullptr && is_lost_zero(*cause);
}

std::string signed_value(double value, double u95, const std::string& unit) {
  const ShownValue read = show_read(value, u95, {1, unit});
  return fmt::format("{}{} ± {} {}", value > 0 ? "+" : "", read.value, read.expanded, unit);
}

}  // namespace

std::vector<ZeroRemedy> zero_remedies(const ErrorBudget& budget) {
  // Adds the zero that a joint lost during the measurement to its earlier error.
  std::map<int, ZeroRemedy> by_joint;
  for (const BudgetLine& line : budget.as_it_stands.lines) {
    if (!is_of_step(line, "zeros") || !line.value) continue;
    ZeroRemedy& zero = by_joint[line.joint];
    zero = {line.joint, zero.add + line.value->value, std::hypot(zero.u95, line.value->u95),
            line.value->unit};
  }
  std::vector<ZeroRemedy> zeros;
  for (const auto& [joint, zero] : by_joint)
    if (std::abs(zero.add) > zero.u95) zeros.push_back(zero);
  return zeros;
}

bool is_of_step(const BudgetLine& line, std::string_view step) {
  if (step == "frames") return line.kind == LineKind::kBase || line.kind == LineKind::kTool;
  if (step == "zeros") return line.kind == LineKind::kJointZero || lost_a_zero(line);
  if (step == "lengths") return line.kind == LineKind::kLength || line.kind == LineKind::kTwist;
  if (step != "loads") return false;
  const CauseRecord* cause = find_cause(line.cause);
  return line.kind == LineKind::kJointCompliance ||
         (cause != nullptr && cause->part == causes::Part::kPayload);
}

std::vector<RemedyValue> remedy_values(const ErrorBudget& budget, std::string_view step) {
  std::vector<RemedyValue> values;
  if (step == "zeros") {
    for (const ZeroRemedy& zero : zero_remedies(budget))
      values.push_back({fmt::format("joint {}", zero.joint + 1), zero.add, zero.u95, zero.unit});
    return values;
  }
  for (const BudgetLine& line : budget.as_it_stands.lines) {
    if (!is_of_step(line, step)) continue;
    std::vector<BudgetNumber> numbers = line.numbers;
    if (numbers.empty() && line.value) numbers = {*line.value};
    for (const BudgetNumber& number : numbers) {
      if (std::abs(number.value) <= number.u95) continue;
      values.push_back({number.name, number.value, number.u95, number.unit});
    }
  }
  return values;
}

std::string MakersWords::axis(int joint) const {
  const auto place = static_cast<std::size_t>(joint);
  return place < axes.size() ? axes[place] : fmt::format("joint {}", joint + 1);
}

MakersWords makers_words(const Chain& robot) {
  const std::string name = lower(robot.name());
  for (const Maker& maker : makers()) {
    if (!name.starts_with(maker.begins)) continue;
    MakersWords words = maker.words;
    if (std::ssize(words.axes) != robot.size()) words.axes.clear();  // its arms of six joints
    return words;
  }
  return {"", "the zero of the axis in the controller",
          "where the controller takes lengths of its own arm", "the load data of the tool"};
}

std::vector<std::string> remedies_in_words(const ErrorBudget& budget, const Chain& robot) {
  if (budget.put_right.empty()) return {"no pose has a measured position: nothing can be said"};
  const MakersWords words = makers_words(robot);
  std::vector<std::string> text;
  for (const PutRight& step : budget.put_right)
    text.push_back(fmt::format("{:<72} {:>9.4f} mm", step.name, to_mm(step.left_rms)));
  const std::vector<ZeroRemedy> zeros = zero_remedies(budget);
  if (!zeros.empty())
    text.push_back(fmt::format("zeros: the joint stands at the angle shown plus this; {}: {}",
                               words.maker.empty() ? "in the controller" : words.maker,
                               words.zeros));
  for (const ZeroRemedy& zero : zeros)
    text.push_back(fmt::format("  {}: {}{}", joint_and_axis(zero.joint, words),
                               signed_value(zero.add, zero.u95, zero.unit),
                               robot.joint(zero.joint).sign < 0
                                   ? " (as the controller counts, against the right-hand rule)"
                                   : ""));
  if (zeros.empty()) text.emplace_back("zeros: none is off by more than its uncertainty");
  text.push_back(fmt::format("lengths: {}", words.lengths));
  text.push_back(fmt::format("load data: {}", words.load));
  return text;
}

}  // namespace trammel
