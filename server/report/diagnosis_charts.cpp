#include "server/report/diagnosis_charts.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/units.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

constexpr Eigen::Index kMostPoints = 500;  // of one periodogram: more than the pixels of a screen
constexpr double kLeastLever = 0.2;  // of a joint's longest: shorter ones turn noise into angles
constexpr double kScaleQuantile = 0.98;  // of the errors before: the end of the colour scale, so
                                         // that one outlier does not make all others look alike

constexpr int kPhaseStep = 5;  // degrees

double to_um(double m) { return m * 1e6; }
double to_urad(double rad) { return rad * 1e6; }
double rounded(double value, double step) { return std::round(value / step) * step; }
double tenth_of_um(double m) { return rounded(to_um(m), 0.1); }

/// The values needed to see a residual as a joint sees it.
class Arm {
 public:
  Arm(const Diagnosis& diagnosis, const Cell& cell) : diagnosis_(diagnosis), cell_(cell) {}

  [[nodiscard]] Eigen::Index poses() const {
    return std::min<Eigen::Index>(
        static_cast<Eigen::Index>(diagnosis_.batch.measurements.size()),
        std::min(diagnosis_.residual_before_B.cols(), diagnosis_.residual_after_B.cols()));
  }
  [[nodiscard]] const PoseContext& context(Eigen::Index pose) const {
    return diagnosis_.batch.measurements[static_cast<std::size_t>(pose)].context;
  }
  /// Nominal tool position, m, in B.
  [[nodiscard]] Vector3 p_B(Eigen::Index pose) const {
    return cell_.robot.flange_pose(context(pose).q) * p_FT(pose);
  }
  [[nodiscard]] double gear_angle(Eigen::Index pose, int joint) const {
    return cell_.robot.gear_angles(context(pose).q)(joint);
  }
  /// The motion of the tool by the joint, m/rad (m/m), in B.
  [[nodiscard]] Vector3 lever_B(Eigen::Index pose, int joint) const {
    return cell_.robot.gear_jacobian(context(pose).q, p_FT(pose)).col(joint).head<3>();
  }
  /// The poses at which the joint moves the tool far enough, with size and direction of that
  /// motion.
  struct Levers {
    std::vector<Eigen::Index> poses;
    std::vector<Vector3> unit_B;
    std::vector<double> length;  ///< m/rad (m/m)
  };
  [[nodiscard]] Levers levers(int joint) const {
    std::vector<Vector3> all;
    double longest = 0;
    for (Eigen::Index i = 0; i < poses(); ++i) {
      all.push_back(lever_B(i, joint));
      longest = std::max(longest, all.back().norm());
    }
    Levers kept;
    for (Eigen::Index i = 0; i < poses(); ++i) {
      const Vector3& lever = all[static_cast<std::size_t>(i)];
      if (!(lever.norm() > kLeastLever * longest)) continue;
      kept.poses.push_back(i);
      kept.unit_B.push_back(lever.normalized());
      kept.length.push_back(lever.norm());
    }
    return kept;
  }

 private:
  [[nodiscard]] Vector3 p_FT(Eigen::Index pose) const {
    const auto tool = cell_.tools.find(context(pose).tool);
    if (tool == cell_.tools.end() || !tool->second) return Vector3::Zero();
    return tool->second->translation();
  }

  const Diagnosis& diagnosis_;
  const Cell& cell_;
};

ordered_json waterfall(const Diagnosis& diagnosis) {
  ordered_json names = ordered_json::array(), rms = ordered_json::array();
  for (const WaterfallStep& step : diagnosis.waterfall) {
    names.push_back(in_words(step.name));
    rms.push_back(tenth_of_um(step.rms));
  }
  return {{"names", names}, {"rms_um", rms}};
}

/// The finding of a joint that shows in its periodogram. A line that stands out may be another
/// joint's.
std::string found_in(const Periodogram& lines, const std::vector<Finding>& findings) {
  std::vector<std::string> orders;
  std::string map;
  for (const Finding& finding : findings) {
    const Cause& cause = finding.cause;
    if (cause.joint != lines.joint) continue;
    const CauseRecord& record = record_of(cause);
    if (cause.order) orders.push_back(fmt::format("{:.2f}", *cause.order));
    if (record.order) orders.push_back(fmt::format("{:.0f}", *record.order));
    if (record.search == causes::SearchFamily::kMap) map = plain_name(record);
  }
  if (orders.empty()) return map.empty() ? "no oscillation found" : map;
  return fmt::format("{} a turn{}{}", fmt::join(orders, ", "), map.empty() ? "" : ", ", map);
}

/// Thinned so that every peak stays: of each stretch its highest point.
ordered_json periodogram(const Periodogram& all, const std::vector<Finding>& findings) {
  ordered_json order = ordered_json::array(), strength = ordered_json::array();
  const Eigen::Index n = all.order.size();
  const Eigen::Index stretch = std::max<Eigen::Index>(1, (n + kMostPoints - 1) / kMostPoints);
  for (Eigen::Index from = 0; from < n; from += stretch) {
    Eigen::Index highest = 0;
    const double peak = all.strength.segment(from, std::min(stretch, n - from)).maxCoeff(&highest);
    order.push_back(rounded(all.order(from + highest), 1e-3));
    strength.push_back(rounded(peak, 1e-2));
  }
  return {{"joint", all.joint + 1},
          {"title", fmt::format("joint {}: {}", all.joint + 1, found_in(all, findings))},
          {"order", order},
          {"strength", strength},
          {"limit", all.limit}};
}

/// A gear's oscillation as it was found.
struct Wave {
  double order = 0, sine = 0, cosine = 0;  ///< cycles a turn; rad
  /// rad, at `angle` of the oscillation itself
  [[nodiscard]] double at(double angle) const {
    return sine * std::sin(angle) + cosine * std::cos(angle);
  }
};

std::optional<Wave> wave_of(const Finding& finding) {
  if (!finding.cause.order || finding.cause.joint < 0) return std::nullopt;
  std::optional<double> sine, cosine;
  for (const Estimate& estimate : finding.parameters) {
    if (estimate.name.starts_with("gear_sin")) sine = estimate.value;
    if (estimate.name.starts_with("gear_cos")) cosine = estimate.value;
  }
  if (!sine || !cosine) return std::nullopt;
  return Wave{*finding.cause.order, *sine, *cosine};
}

/// The oscillation over one cycle, for a line.
ordered_json cycle_of(const Wave& wave) {
  ordered_json phase = ordered_json::array(), urad = ordered_json::array();
  for (int degrees = 0; degrees <= 360; degrees += kPhaseStep) {
    phase.push_back(degrees);
    urad.push_back(rounded(to_urad(wave.at(from_deg(degrees))), 0.1));
  }
  return {{"phase_deg", phase}, {"urad", urad}};
}

/// The joint's error against the phase of its gear's oscillation: without it, with it alone, and
/// with all other findings.
ordered_json fold(const Diagnosis& diagnosis, const Arm& arm, int joint, const Wave& wave) {
  ordered_json phase = ordered_json::array(), alone = ordered_json::array(),
               after = ordered_json::array();
  const Arm::Levers levers = arm.levers(joint);
  for (std::size_t k = 0; k < levers.poses.size(); ++k) {
    const Eigen::Index i = levers.poses[k];
    const double angle = wave.order * arm.gear_angle(i, joint);
    const double left = levers.unit_B[k].dot(diagnosis.residual_after_B.col(i)) / levers.length[k];
    phase.push_back(rounded(to_deg(angle - 2 * kPi * std::floor(angle / (2 * kPi))), 0.1));
    alone.push_back(rounded(to_urad(left + wave.at(angle)), 0.1));
    after.push_back(rounded(to_urad(left), 0.1));
  }
  return {{"joint", joint + 1},  {"order", wave.order}, {"phase_deg", phase},
          {"alone_urad", alone}, {"after_urad", after}, {"cycle", cycle_of(wave)}};
}

ordered_json folds(const Diagnosis& diagnosis, const Arm& arm) {
  ordered_json list = ordered_json::array();
  for (const Finding& finding : diagnosis.findings) {
    if (const auto wave = wave_of(finding))
      list.push_back(fold(diagnosis, arm, finding.cause.joint, *wave));
  }
  return list;
}

ordered_json axes_um(const Eigen::Matrix3Xd& e_B, Eigen::Index poses) {
  ordered_json axes;
  for (int k = 0; k < 3; ++k) {
    ordered_json values = ordered_json::array();
    for (Eigen::Index i = 0; i < poses; ++i) values.push_back(tenth_of_um(e_B(k, i)));
    axes[std::string(1, "xyz"[k])] = values;
  }
  return axes;
}

/// Against time, or against the order of measuring where no time was recorded.
ordered_json over_time(const Diagnosis& diagnosis, const Arm& arm) {
  bool recorded = arm.poses() > 0;
  for (Eigen::Index i = 0; i < arm.poses(); ++i) recorded = recorded && arm.context(i).time;
  ordered_json at = ordered_json::array();
  for (Eigen::Index i = 0; i < arm.poses(); ++i) {
    at.push_back(recorded ? rounded((*arm.context(i).time - *arm.context(0).time) / 60, 1e-3)
                          : static_cast<double>(i + 1));
  }
  return {{"recorded", recorded},
          {"at", at},
          {"before_um", axes_um(diagnosis.residual_before_B, arm.poses())},
          {"after_um", axes_um(diagnosis.residual_after_B, arm.poses())}};
}

/// Mean residual along one joint's motion by the side it was approached from; empty where there is
/// only one side.
ordered_json approached(const Diagnosis& diagnosis, const Arm& arm, int joint) {
  const Arm::Levers levers = arm.levers(joint);
  double before[2] = {0, 0}, after[2] = {0, 0};
  int count[2] = {0, 0};
  for (std::size_t k = 0; k < levers.poses.size(); ++k) {
    const Eigen::Index i = levers.poses[k];
    const auto& direction = arm.context(i).direction;
    const int sense = direction.empty() ? 0 : direction[static_cast<std::size_t>(joint)];
    if (sense == 0) continue;
    const int side = sense > 0 ? 1 : 0;
    before[side] += levers.unit_B[k].dot(diagnosis.residual_before_B.col(i));
    after[side] += levers.unit_B[k].dot(diagnosis.residual_after_B.col(i));
    ++count[side];
  }
  if (count[0] == 0 || count[1] == 0) return nullptr;
  const auto mean = [&](const double* sum, int side) {
    return tenth_of_um(sum[side] / count[side]);
  };
  return {{"joint", joint + 1},
          {"before_um", {mean(before, 0), mean(before, 1)}},
          {"after_um", {mean(after, 0), mean(after, 1)}}};
}

ordered_json by_direction(const Diagnosis& diagnosis, const Arm& arm, const Cell& cell) {
  ordered_json joints = ordered_json::array();
  for (int joint = 0; joint < cell.robot.size(); ++joint) {
    ordered_json one = approached(diagnosis, arm, joint);
    if (!one.is_null()) joints.push_back(std::move(one));
  }
  return joints;
}

/// Residual away from the robot's base against temperature: the effect of growing links.
ordered_json by_temperature(const Diagnosis& diagnosis, const Arm& arm) {
  ordered_json at = ordered_json::array(), before = ordered_json::array(),
               after = ordered_json::array();
  for (Eigen::Index i = 0; i < arm.poses(); ++i) {
    if (!arm.context(i).temperature) continue;
    const Vector3 outward_B = arm.p_B(i).normalized();
    at.push_back(rounded(*arm.context(i).temperature, 1e-2));
    before.push_back(tenth_of_um(outward_B.dot(diagnosis.residual_before_B.col(i))));
    after.push_back(tenth_of_um(outward_B.dot(diagnosis.residual_after_B.col(i))));
  }
  if (at.empty()) return nullptr;
  return {{"at", at}, {"before_um", before}, {"after_um", after}};
}

ordered_json sizes_um(const Eigen::Matrix3Xd& e_B, Eigen::Index poses) {
  ordered_json sizes = ordered_json::array();
  for (Eigen::Index i = 0; i < poses; ++i) sizes.push_back(tenth_of_um(e_B.col(i).norm()));
  return sizes;
}

double scale_end(const Eigen::Matrix3Xd& e_B) {
  if (e_B.cols() == 0) return 0;
  Eigen::VectorXd sizes = e_B.colwise().norm();
  std::sort(sizes.begin(), sizes.end());
  return sizes(static_cast<Eigen::Index>(kScaleQuantile * static_cast<double>(sizes.size() - 1)));
}

ordered_json maps(const Diagnosis& diagnosis, const Arm& arm) {
  ordered_json place = {
      {"x", ordered_json::array()}, {"y", ordered_json::array()}, {"z", ordered_json::array()}};
  for (Eigen::Index i = 0; i < arm.poses(); ++i) {
    const Vector3 p_B = arm.p_B(i);
    for (int k = 0; k < 3; ++k)
      place[std::string(1, "xyz"[k])].push_back(rounded(to_mm(p_B(k)), 0.1));
  }
  return {{"place_mm", place},
          {"before_um", sizes_um(diagnosis.residual_before_B, arm.poses())},
          {"after_um", sizes_um(diagnosis.residual_after_B, arm.poses())},
          {"scale_um", tenth_of_um(scale_end(diagnosis.residual_before_B))}};
}

ordered_json recovery(const Recovery& curve) {
  ordered_json effect = ordered_json::array(), named = ordered_json::array();
  for (Eigen::Index k = 0; k < curve.effect_rms.size(); ++k) {
    effect.push_back(tenth_of_um(curve.effect_rms(k)));
    named.push_back(rounded(100 * curve.named(k), 0.1));
  }
  return {{"cause", in_words(curve.cause)}, {"effect_um", effect}, {"named_percent", named}};
}

template <typename Items, typename Draw>
ordered_json each(const Items& items, const Draw& draw) {
  ordered_json list = ordered_json::array();
  for (const auto& item : items) list.push_back(draw(item));
  return list;
}

}  // namespace

ordered_json diagnosis_charts(const Diagnosis& diagnosis, const Cell& cell) {
  const Arm arm(diagnosis, cell);
  ordered_json charts = ordered_json::object();
  const auto put = [&](const char* name, ordered_json chart) {
    if (!chart.is_null() && !chart.empty()) charts[name] = std::move(chart);
  };
  if (!diagnosis.waterfall.empty()) put("waterfall", waterfall(diagnosis));
  put("periodograms", each(diagnosis.periodograms, [&](const Periodogram& one) {
        return periodogram(one, diagnosis.findings);
      }));
  put("recovery", each(diagnosis.recovery, recovery));
  if (arm.poses() == 0) return charts;
  put("folds", folds(diagnosis, arm));
  put("time", over_time(diagnosis, arm));
  put("direction", by_direction(diagnosis, arm, cell));
  put("temperature", by_temperature(diagnosis, arm));
  put("maps", maps(diagnosis, arm));
  return charts;
}

}  // namespace trammel
