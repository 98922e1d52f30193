#include "server/compensate/budget/usual.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "server/base/units.h"
#include "server/error_sources/catalogue.h"

namespace trammel {

namespace {

constexpr double kKilo = 1e3;        // the unit of a gearbox is deg/kNm
constexpr double kFrameShift = 0.1;  // m
constexpr double kFrameTurn = 0.1;   // rad
constexpr double kToolShift = 0.02;  // m
constexpr double kToolTurn = 0.02;   // rad

/// m: the longest stretch of the drawing.
double reach_of(const Chain& robot) {
  double reach = 0;
  for (int j = 0; j < robot.size(); ++j)
    reach += std::hypot(robot.joint(j).link.a, robot.joint(j).link.d);
  return reach;
}

/// The usual compliance of an arm's joints, including the bearings and links beside their gears, by
/// the reach of the arm. The README of the room has the figures of gears behind these numbers.
struct GearsOfSize {
  double up_to;        // m
  double gear, wrist;  // deg/kNm
};
constexpr GearsOfSize kGears[] = {
    {1.3, 4, 12}, {2, 2, 6}, {3, 0.4, 3}, {std::numeric_limits<double>::infinity(), 0.15, 0.5}};
constexpr int kWristJoints = 3;

bool is_length(const Parameter& parameter) { return parameter.unit == "mm"; }

}  // namespace

UsualSizes usual_sizes(const Chain& robot) {
  // A mastered zero repeats to about 0.02 degrees, and its reference is of the same size; axes are
  // bored to about 0.03 degrees; cast links are machined to some tenths of a millimetre, and with
  // their length.
  UsualSizes usual;
  usual.zero = from_deg(0.06);
  usual.rail_zero = from_mm(1.0);
  usual.twist = from_deg(0.06);
  usual.length = from_mm(0.5 + 0.2 * reach_of(robot));
  usual.tool = from_mm(2.0);
  const double reach = reach_of(robot);
  const auto* gears = std::find_if(std::begin(kGears), std::end(kGears),
                                   [&](const GearsOfSize& one) { return reach <= one.up_to; });
  usual.gear = from_deg(gears->gear) / kKilo;
  usual.wrist = from_deg(gears->wrist) / kKilo;
  return usual;
}

std::optional<double> usual_value(const BudgetItem& item, const PhysicalModel& model) {
  const Chain& robot = model.cell->robot;
  const UsualSizes usual = usual_sizes(robot);
  const int joint = item.line.joint;
  const bool turns = joint >= 0 && robot.joint(joint).type == JointType::kRevolute;
  switch (item.line.kind) {
    case LineKind::kCause:
      if (joint < 0 || !is_lost_zero(model.sources[item.source]->cause())) return std::nullopt;
      [[fallthrough]];
    case LineKind::kJointZero:
      return turns ? to_deg(usual.zero) : to_mm(usual.rail_zero);
    case LineKind::kJointCompliance:
      if (!turns) return std::nullopt;
      return kKilo * to_deg(joint < robot.size() - kWristJoints ? usual.gear : usual.wrist);
    case LineKind::kTwist:
      return to_deg(usual.twist);
    case LineKind::kLength:
      return to_mm(usual.length);
    case LineKind::kTool:
      return to_mm(usual.tool);
    default:
      return std::nullopt;
  }
}

Eigen::VectorXd sizes_to_compare_by(const PhysicalModel& model) {
  const UsualSizes usual = usual_sizes(model.cell->robot);
  Eigen::VectorXd sizes(model.parameter_count());
  Eigen::Index k = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    for (const Parameter& parameter : source->parameters()) {
      const bool length = is_length(parameter);
      switch (source->cause().part) {
        case causes::Part::kBase:
          sizes(k++) = length ? kFrameShift : kFrameTurn;
          break;
        case causes::Part::kTool:
          sizes(k++) = length ? kToolShift : kToolTurn;
          break;
        case causes::Part::kLinks:
          sizes(k++) = length ? usual.length : usual.zero;
          break;
        default:
          sizes(k++) = parameter.prior_scale;
      }
    }
  }
  return sizes;
}

std::string action_for(const BudgetLine& line, const PhysicalModel& model) {
  const int n = line.joint + 1;
  switch (line.kind) {
    case LineKind::kJointZero:
      return fmt::format("re-master joint {}", n);
    case LineKind::kLength:
      return fmt::format(
          "compare the robot file with the maker's drawing: is it of another reach? Else look at "
          "link {}",
          n);
    case LineKind::kTwist:
      return fmt::format("look at link {}: was it bent, or a bearing changed?", n);
    case LineKind::kTool:
      return "measure the tool again and correct the cell file";
    case LineKind::kJointCompliance:
      return fmt::format("check the payload in the cell file, then the gearbox of joint {}", n);
    case LineKind::kCause: {
      const CauseRecord* record = find_cause(line.cause);
      return record != nullptr ? std::string(record->action) : "";
    }
    default:
      static_cast<void>(model);
      return "";
  }
}

}  // namespace trammel
