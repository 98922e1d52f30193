#include "clients/cam/stated_robot.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "clients/cam/number_text.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/robot/inverse_kinematics.h"

namespace trammel::cam {

namespace {

constexpr double kSameLength = 1e-4;  // m: both lengths come from the drawing
constexpr double kSameAngle = 1e-4;   // rad
constexpr std::size_t kFewest = 3;    // digits of a reach: R2700, R900
constexpr double kSameReach = 0.06;   // m: 0.58 is also called 0.6
constexpr double kSameUp = 0.09;      // rad: 5 deg
constexpr double kSameLimit = 9e-4;   // rad: 0.05 deg

double angle_between(const Vector3& a, const Vector3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

std::string direction_text(const Vector3& direction) {
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", direction.x() + 0.0, direction.y() + 0.0,
                     direction.z() + 0.0);
}

/// deg, as people write the end of an axis.
double rounded(double degrees) { return std::round(degrees * 1e3) / 1e3; }

std::string place_of(const StatedBase& base) {
  return base.line == 0 ? fmt::format("{} of {}", base.name, base.file)
                        : fmt::format("{} ({} line {})", base.name, base.file, base.line);
}

/// The turning axes alone, as they stand on a rail; empty: no chain of their own.
std::optional<Chain> arm_of(const Chain& robot) {
  std::vector<Joint> turning;
  for (int j = 0; j < robot.size(); ++j) {
    if (robot.joint(j).type == JointType::kRevolute) turning.push_back(robot.joint(j));
  }
  Result<Chain> arm = Chain::make(robot.name(), std::move(turning));
  return arm ? std::optional<Chain>(std::move(*arm)) : std::nullopt;
}

/// The number by the robot file; empty: such an arm has no such number.
std::optional<double> number_of(ArmNumber number, const Chain& robot) {
  const std::optional<Chain> arm = arm_of(robot);
  if (!arm) return std::nullopt;
  if (number == ArmNumber::kAxes) return arm->size();
  const bool on_rail = arm->size() != robot.size();
  if (!has_spherical_wrist(*arm) || (on_rail && number == ArmNumber::kHeightOfAxis2))
    return std::nullopt;
  const auto link = [&](int j) { return arm->joint(j).link; };
  switch (number) {
    case ArmNumber::kHeightOfAxis2:
      return link(0).d;
    case ArmNumber::kAxis1ToAxis2:
      return std::abs(link(0).a);
    case ArmNumber::kAxis2ToAxis3:
      return std::abs(link(1).a);
    case ArmNumber::kAxis3ToWrist:
      return std::hypot(link(2).a, link(3).d);
    case ArmNumber::kWristToFlange:
      return std::abs(link(5).d);
    case ArmNumber::kTiltOfFlange:
      return std::abs(std::remainder(link(5).alpha, 2 * kPi));
    case ArmNumber::kAxes:
      break;
  }
  return std::nullopt;
}

const char* words_for(ArmNumber number) {
  switch (number) {
    case ArmNumber::kHeightOfAxis2:
      return "from the base up to axis 2";
    case ArmNumber::kAxis1ToAxis2:
      return "from axis 1 to axis 2";
    case ArmNumber::kAxis2ToAxis3:
      return "from axis 2 to axis 3";
    case ArmNumber::kAxis3ToWrist:
      return "from axis 3 to the wrist";
    case ArmNumber::kWristToFlange:
      return "from the wrist to the flange";
    case ArmNumber::kTiltOfFlange:
      return "from the last axis to that of the flange";
    case ArmNumber::kAxes:
      break;
  }
  return "turning axes";
}

std::optional<Error> contradiction(const StatedNumber& stated, const Chain& robot) {
  const std::optional<double> ours = number_of(stated.of, robot);
  if (!ours) return std::nullopt;
  if (stated.of == ArmNumber::kAxes) {
    if (stated.value == *ours) return std::nullopt;
    return refused("{} says {:g} {}, the robot file of {} has {:g}", stated.name, stated.value,
                   words_for(stated.of), shown(robot.name()), *ours)
        .in(stated.file)
        .at_row(stated.line)
        .of(stated.name)
        .beyond(stated.value, *ours)
        .next("correct with the model of the robot that this controller moves")
        .value();
  }
  const bool turns = stated.of == ArmNumber::kTiltOfFlange;
  const double apart = std::abs(std::abs(stated.value) - std::abs(*ours));
  if (apart <= (turns ? kSameAngle : kSameLength)) return std::nullopt;
  const auto told = [&](double value) { return turns ? to_deg(value) : to_mm(value); };
  const char* unit = turns ? "deg" : "mm";
  return refused("{} says {:.3f} {} {}, the robot file of {} has {:.3f} {}: {:.3f} {} apart",
                 stated.name, told(stated.value), unit, words_for(stated.of), shown(robot.name()),
                 told(*ours), unit, told(apart), unit)
      .in(stated.file)
      .at_row(stated.line)
      .of(stated.name)
      .beyond(told(stated.value), told(*ours))
      .next("correct with the model of the robot that this controller moves")
      .value();
}

/// The digits behind `letters`: 210 of `KR 210 R2700` behind `KR`, 2700 behind `R`.
std::string digits_behind(const std::string& type, const std::string& letters, std::size_t fewest) {
  for (std::size_t at = type.find(letters); at != std::string::npos;
       at = type.find(letters, at + 1)) {
    const std::size_t first =
        std::min(type.find_first_not_of(" _-", at + letters.size()), type.size());
    const std::size_t end = std::min(type.find_first_not_of("0123456789", first), type.size());
    const bool whole = at == 0 || std::isalpha(static_cast<unsigned char>(type[at - 1])) == 0;
    if (whole && end - first >= fewest) return type.substr(first, end - first);
  }
  return "";
}

/// ABB's number of a model: 6640 of `ROB1_6640_2.75_205`.
std::string abb_model(const std::string& type) {
  const std::size_t first =
      type.starts_with("ROB") ? std::min(type.find('_'), type.size() - 1) + 1 : type.size();
  return type.substr(first,
                     std::min(type.find_first_not_of("0123456789", first), type.size()) - first);
}

/// m, of `ROB1_6640_2.75_205` and of `IRB 6640-205/2.75`: the number with a point; 0: there is
/// none.
double abb_reach(const std::string& type) {
  const std::size_t point = type.find('.');
  if (point == std::string::npos || point == 0) return 0;
  const std::size_t before = type.find_last_not_of("0123456789", point - 1);
  const std::size_t first = before == std::string::npos ? 0 : before + 1;
  const std::size_t end = std::min(type.find_first_not_of("0123456789", point + 1), type.size());
  const auto reach = read_number(std::string_view(type).substr(first, end - first));
  return reach ? reach->value : 0;
}

/// ABB's load and reach behind the model: 205 and 2.75 of `IRB 6640-205/2.75`, 205 and 275 of
/// `ROB1_6640_205_275`.
std::vector<double> numbers_behind(const std::string& type, const std::string& model) {
  std::vector<double> numbers;
  std::size_t at = type.find(model) + model.size();
  while ((at = type.find_first_of("0123456789", at)) < type.size()) {
    const std::size_t end = std::min(type.find_first_not_of("0123456789.", at), type.size());
    if (const auto number = read_number(std::string_view(type).substr(at, end - at)))
      numbers.push_back(number->value);
    at = end;
  }
  return numbers;
}

bool is_abb_type(const std::string& theirs, const std::string& ours) {
  const std::string model = abb_model(theirs);
  if (model.empty() || model != digits_behind(ours, "IRB", 2)) return false;
  const std::vector<double> said = numbers_behind(theirs, model),
                            wanted = numbers_behind(ours, model);
  const double reach = abb_reach(ours);
  const auto has = [&](double number) {
    return std::any_of(said.begin(), said.end(), [&](double one) {
      constexpr double kCentimetres = 100;
      return number == reach ? std::abs(one - reach) <= kSameReach ||
                                   std::abs(one / kCentimetres - reach) <= kSameReach
                             : one == number;
    });
  };
  return std::all_of(wanted.begin(), wanted.end(), has);
}

/// The words of a name; `KR210R2700 EXTRA` has KR210R2700 and EXTRA.
std::vector<std::string> words_of_name(const std::string& name) {
  std::vector<std::string> words;
  for (std::size_t at = 0; (at = name.find_first_not_of(" #_", at)) < name.size();) {
    const std::size_t end = std::min(name.find_first_of(" #_", at), name.size());
    words.push_back(name.substr(at, end - at));
    at = end;
  }
  return words;
}

bool is_kuka_type(const std::string& theirs, const std::string& ours) {
  const std::string load = digits_behind(ours, "KR", 1), reach = digits_behind(ours, "R", kFewest);
  if (load.empty() || reach.empty() || digits_behind(theirs, "KR", 1) != load ||
      digits_behind(theirs, "R", kFewest) != reach)
    return false;
  const std::vector<std::string> said = words_of_name(theirs), wanted = words_of_name(ours);
  return std::all_of(wanted.begin(), wanted.end(), [&](const std::string& word) {
    const bool plain =
        word.find_first_of("0123456789") == std::string::npos && word != "KUKA" && word != "KR";
    return !plain || std::find(said.begin(), said.end(), word) != said.end();
  });
}

/// FANUC's and Yaskawa's types are the name of the robot without the maker's name.
bool is_plain_type(const std::string& theirs, const std::string& ours) {
  std::string name = ours;
  for (const char* maker : {"FANUC ", "YASKAWA ", "MOTOMAN "})
    if (name.starts_with(maker)) name.erase(0, std::string_view(maker).size());
  return name != ours && theirs == name;
}

/// The coupling of a turning axis in the robot file; nullptr: it follows no other.
const Coupling* coupling_of(const Chain& robot, int axis) {
  for (int j = 0; j < robot.size(); ++j) {
    if (robot.joint(j).type != JointType::kRevolute || axis-- != 0) continue;
    for (const Coupling& coupling : robot.couplings()) {
      if (coupling.joint == j) return &coupling;
    }
  }
  return nullptr;
}

/// ABB's arms whose axis 3 is held by bars.
bool has_bars(const std::string& abb) {
  static const std::set<std::string> kModels = {"1400", "1410", "2400", "4400", "4450", "6660"};
  return kModels.contains(abb);
}

std::optional<Error> contradiction(const StatedCoupling& stated, const Chain& robot) {
  if (coupling_of(robot, stated.axis) != nullptr) return std::nullopt;
  return refused(
             "{} {} says that axis {} follows another one, the robot file of {} has no coupling of "
             "it",
             stated.name, shown(stated.text), stated.axis + 1, shown(robot.name()))
      .in(stated.file)
      .at_row(stated.line)
      .of(stated.name)
      .next("correct with the model of the robot that this controller moves")
      .value();
}

/// `on the floor`, `upside down`, `on a wall`, as people call how a robot is mounted.
const char* mounting(const Vector3& up_B) {
  constexpr double kUpright = 0.7;
  return up_B.z() > kUpright ? "standing" : up_B.z() < -kUpright ? "hanging" : "on a wall";
}

/// The base of the controller's files, turned against the vertical otherwise than the cell's.
std::vector<std::string> against_mounting(const StatedRobot& stated, const CellTools& cell) {
  if (stated.bases.empty() || !cell.gravity_B) return {};
  const StatedBase& base = stated.bases.front();
  const Vector3 by_files = base.X_WB.linear().transpose() * Vector3::UnitZ(),
                by_cell = -*cell.gravity_B;
  const double tilted = angle_between(by_files, by_cell);
  if (tilted <= kSameUp) return {};
  return {fmt::format(
      "by {} the robot is {}, up is {} in its base; by the cell's base and gravity it is {}, up is "
      "{}: {:.0f} deg apart. Gravity bends an arm otherwise that is mounted otherwise: see that "
      "the model is of this robot",
      place_of(base), mounting(by_files), direction_text(by_files), mounting(by_cell),
      direction_text(by_cell), to_deg(tilted))};
}

/// The ends of axes that are not those of the robot file; empty: none is.
std::string against_limits(const StatedRobot& stated, const Chain& robot) {
  std::vector<int> turning;
  for (int j = 0; j < robot.size(); ++j)
    if (robot.joint(j).type == JointType::kRevolute) turning.push_back(j);
  std::vector<std::string> ends;
  std::string file;
  bool beyond = false;
  for (const StatedLimit& limit : stated.limits) {
    if (limit.axis >= static_cast<int>(turning.size())) continue;
    const Joint& joint = robot.joint(turning[static_cast<std::size_t>(limit.axis)]);
    const double ours = limit.upper ? joint.upper : joint.lower;
    if (std::abs(limit.value - ours) <= kSameLimit) continue;
    beyond |= limit.upper ? limit.value > ours : limit.value < ours;
    file = limit.file;
    ends.push_back(fmt::format("{} (line {}) {:g}, there {:g}", limit.name, limit.line,
                               rounded(to_deg(limit.value)), rounded(to_deg(ours))));
  }
  if (ends.empty()) return "";
  return fmt::format(
      "ends of axes in {} are not those of the robot file of {}, deg: {}. {}", file,
      shown(robot.name()), fmt::join(ends, "; "),
      beyond ? "A controller that lets an axis go further than the drawing may be of another arm"
             : "The controller stops short of the robot file: a target beyond its ends is run into "
               "a limit");
}

/// KUKA's types say load and reach, KR 210 R2700. Words beside them are spelled in many ways.
std::optional<Error> contradiction(const StatedType& stated, const Chain& robot) {
  const std::string theirs = upper(stated.type), ours = upper(robot.name());
  const auto differ = [&](const std::string& letters, std::size_t fewest) {
    const std::string a = digits_behind(theirs, letters, fewest),
                      b = digits_behind(ours, letters, fewest);
    return !a.empty() && !b.empty() && a != b;
  };
  const std::string abb = abb_model(theirs), irb = digits_behind(ours, "IRB", 2);
  const bool both_abb = !abb.empty() && !irb.empty();
  const double reach = abb_reach(theirs), our_reach = abb_reach(ours);
  const bool other_reach =
      both_abb && reach > 0 && our_reach > 0 && std::abs(reach - our_reach) > kSameReach;
  const bool other_abb = (both_abb && abb != irb) || other_reach;
  if (!other_abb && has_bars(abb)) {
    const Coupling* coupling = coupling_of(robot, 2);
    if (coupling == nullptr || coupling->kind != CouplingKind::kParallelogram)
      return refused("{} says {}, an arm whose axis 3 is held by bars, the robot file of {} has {}",
                     stated.name, shown(stated.type), shown(robot.name()),
                     coupling == nullptr ? "no coupling of it" : "a coupling of kind controller")
          .in(stated.file)
          .at_row(stated.line)
          .of(stated.name)
          .with_text(stated.type)
          .next("give the robot file the coupling of axis 3 with kind: parallelogram")
          .value();
  }
  if (!other_abb && !differ("KR", 1) && !differ("R", kFewest)) return std::nullopt;
  return refused("{} says {}, the robot file is of {}", stated.name, shown(stated.type),
                 shown(robot.name()))
      .in(stated.file)
      .at_row(stated.line)
      .of(stated.name)
      .with_text(stated.type)
      .next("correct with the model of the robot that this controller moves")
      .value();
}

}  // namespace

bool is_type(const std::string& type, const std::string& robot) {
  const std::string theirs = upper(type), ours = upper(robot);
  return is_abb_type(theirs, ours) || is_kuka_type(theirs, ours) || is_plain_type(theirs, ours);
}

void take_stated(const StatedRobot& stated, StatedRobot& all) {
  all.bases.insert(all.bases.end(), stated.bases.begin(), stated.bases.end());
  all.numbers.insert(all.numbers.end(), stated.numbers.begin(), stated.numbers.end());
  all.types.insert(all.types.end(), stated.types.begin(), stated.types.end());
  all.couplings.insert(all.couplings.end(), stated.couplings.begin(), stated.couplings.end());
  all.limits.insert(all.limits.end(), stated.limits.begin(), stated.limits.end());
  all.ups.insert(all.ups.end(), stated.ups.begin(), stated.ups.end());
}

void stand_in_world(Program& program, const ReadOptions& options) {
  if (const auto row = options.frames.find(kRobotBase); row != options.frames.end())
    program.bases.insert(program.bases.begin(), {row->second, kRobotBase, "--frames", 0});
  if (program.bases.empty()) return;
  const Pose X_BW = program.bases.front().X_WB.inverse();
  for (ProgramFrame& frame : program.frames) {
    if (!frame.in_base) frame.X_BO = X_BW * frame.X_BO;
  }
}

Status check_stated_robot(const Program& program, const Chain& robot) {
  std::vector<Error> problems;
  for (const StatedBase& base : program.bases) {
    const StatedBase& first = program.bases.front();
    if (same_place(base.X_WB, first.X_WB)) continue;
    Failure two = refused("the robot stands at {} in the controller's world by {}, at {} by {}: {}",
                          pose_text(first.X_WB), place_of(first), pose_text(base.X_WB),
                          place_of(base), apart_text(first.X_WB, base.X_WB))
                      .in(base.file)
                      .of(base.name)
                      .next("mend the one that is wrong");
    if (base.line > 0) two.value().row = base.line;
    problems.push_back(two.value());
  }
  const auto add = [&](std::optional<Error> error) {
    if (error) problems.push_back(std::move(*error));
  };
  for (const StatedNumber& number : program.numbers) add(contradiction(number, robot));
  for (const StatedType& type : program.types) add(contradiction(type, robot));
  for (const StatedCoupling& coupling : program.couplings) add(contradiction(coupling, robot));
  if (!problems.empty()) return tl::make_unexpected(together(std::move(problems)));
  return {};
}

Status check_gravity(const Program& program, const CellTools& cell) {
  std::vector<Error> problems;
  for (const StatedUp& up : program.ups) {
    const double apart = cell.gravity_B ? angle_between(up.up_B, -*cell.gravity_B) : 0;
    if (apart <= kSameUp) continue;
    problems.push_back(refused("by {} up is {} in the robot's base, by the cell's base and gravity "
                               "it is {}: the robot is mounted {:.0f} deg otherwise",
                               up.name, direction_text(up.up_B), direction_text(-*cell.gravity_B),
                               to_deg(apart))
                           .in(up.file)
                           .at_row(up.line)
                           .of(up.name)
                           .next("mend the one that is wrong")
                           .value());
  }
  if (!problems.empty()) return tl::make_unexpected(together(std::move(problems)));
  return {};
}

std::vector<std::string> contradictions_of(const StatedRobot& stated, const Chain& robot,
                                           const CellTools& cell) {
  std::vector<std::string> sentences = against_mounting(stated, cell);
  if (std::string limits = against_limits(stated, robot); !limits.empty())
    sentences.push_back(std::move(limits));
  return sentences;
}

std::vector<std::string> notes_on_base(const Program& program, const CellTools& cell) {
  if (program.bases.empty() || same_place(program.bases.front().X_WB, Pose::Identity())) return {};
  const StatedBase& base = program.bases.front();
  std::string stands = fmt::format(
      "the robot stands at {} in the controller's world, by {}: targets are taken from there",
      pose_text(base.X_WB), place_of(base));
  if (cell.X_WB && !same_place(*cell.X_WB, base.X_WB))
    stands += fmt::format("; the cell's base, {}, is seen from its measuring system",
                          pose_text(*cell.X_WB));
  std::vector<std::string> notes = {stands};
  std::vector<std::string> rows;
  for (const ProgramFrame& frame : program.frames) {
    if (frame.in_base && !frame.row.empty()) rows.push_back(shown(frame.row));
  }
  if (!rows.empty())
    notes.push_back(fmt::format(
        "{} of --frames: taken as seen from the robot's base, not from the controller's world",
        fmt::join(rows, ", ")));
  return notes;
}

}  // namespace trammel::cam
