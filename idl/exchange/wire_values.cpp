#include "idl/exchange/wire_values.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>
#include <vector>

#include "server/base/units.h"

namespace trammel::wire {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::array kWords = {"ok",       "out_of_domain", "joint_limit", "unreachable",
                               "singular", "not_converged", "refused"};  // of TargetStatus

/// rad that are these degrees again, to the last bit, when the client turns them round.
double rad_of(double deg) {
  const double rad = from_deg(deg);
  for (const double near : {rad, std::nextafter(rad, HUGE_VAL), std::nextafter(rad, -HUGE_VAL)}) {
    if (to_deg(near) == deg) return near;
  }
  return rad;
}

TargetStatus status_called(std::string_view word) {
  const auto found = std::find(kWords.begin(), kWords.end(), word);
  return found == kWords.end() ? TARGET_REFUSED
                               : static_cast<TargetStatus>(std::distance(kWords.begin(), found));
}

std::vector<double> joints_in_degrees(const std::vector<double>& joints_rad,
                                      const exchange::Rails& rails) {
  std::vector<double> joints;
  for (const double value : joints_rad)
    joints.push_back(exchange::is_rail(rails, joints.size()) ? value : to_deg(value));
  return joints;
}

std::vector<double> joints_on_wire(const std::vector<double>& joints_deg,
                                   const exchange::Rails& rails) {
  std::vector<double> joints;
  for (const double value : joints_deg)
    joints.push_back(exchange::is_rail(rails, joints.size()) ? value : rad_of(value));
  return joints;
}

double square(double value) { return value * value; }

}  // namespace

const char* word_of(TargetStatus status) { return kWords.at(static_cast<std::size_t>(status)); }

PoseMm to_wire(const exchange::Pose& pose) {
  PoseMm out;
  out.x_mm(pose.xyz_mm[0]);
  out.y_mm(pose.xyz_mm[1]);
  out.z_mm(pose.xyz_mm[2]);
  out.qw(pose.q_wxyz[0]);
  out.qx(pose.q_wxyz[1]);
  out.qy(pose.q_wxyz[2]);
  out.qz(pose.q_wxyz[3]);
  return out;
}

exchange::Pose from_wire(const PoseMm& pose) {
  return {{pose.x_mm(), pose.y_mm(), pose.z_mm()}, {pose.qw(), pose.qx(), pose.qy(), pose.qz()}};
}

Approach to_wire(const exchange::Approach& approach) {
  Approach out;
  out.directions().assign(approach.directions.begin(), approach.directions.end());
  out.temperature_c(approach.temperature_c.value_or(kUnknown));
  out.time_s(approach.time_s.value_or(kUnknown));
  return out;
}

CommandedJoints to_wire(const exchange::AskedJoints& asked) {
  CommandedJoints out;
  out.joints_rad(asked.q_rad);
  out.approach(to_wire(asked.approach));
  return out;
}

Target to_wire(const exchange::AskedTarget& asked) {
  Target out;
  if (asked.joint_target) {
    out.kind(TARGET_JOINTS);
  } else {
    out.kind(asked.conf ? TARGET_POSE_ON_BRANCH : TARGET_POSE_NEAR_JOINTS);
  }
  out.pose(to_wire(asked.pose));
  out.joints_rad(asked.seed_rad);
  out.conf(asked.conf.value_or(0));
  out.approach(to_wire(asked.approach));
  return out;
}

PredictedError to_wire(const exchange::Prediction& p) {
  const auto& e = p.error_mm;
  const auto& s = p.stddev_mm;
  const auto& t = p.true_stddev_mm;
  const auto& c = p.covariance_mm2;
  const auto& r = p.rotation_deg;
  PredictedError out;
  out.nominal(to_wire(p.nominal));
  out.predicted(to_wire(p.predicted));
  out.dx_mm(e[0]), out.dy_mm(e[1]), out.dz_mm(e[2]);
  out.sx_mm(s[0]), out.sy_mm(s[1]), out.sz_mm(s[2]);
  out.slx_mm(t[0]), out.sly_mm(t[1]), out.slz_mm(t[2]);
  out.cxy_mm2(c[1]), out.cxz_mm2(c[2]), out.cyz_mm2(c[5]);
  out.rx_rad(rad_of(r[0])), out.ry_rad(rad_of(r[1])), out.rz_rad(rad_of(r[2]));
  const auto turned = p.rotation_stddev_deg.value_or(std::array{kUnknown, kUnknown, kUnknown});
  out.srx_rad(rad_of(turned[0])), out.sry_rad(rad_of(turned[1])), out.srz_rad(rad_of(turned[2]));
  out.bias_share(p.bias_share);
  out.in_domain(p.in_domain);
  return out;
}

exchange::Prediction from_wire(const PredictedError& p) {
  exchange::Prediction out;
  out.nominal = from_wire(p.nominal());
  out.predicted = from_wire(p.predicted());
  out.error_mm = {p.dx_mm(), p.dy_mm(), p.dz_mm()};
  out.stddev_mm = {p.sx_mm(), p.sy_mm(), p.sz_mm()};
  out.true_stddev_mm = {p.slx_mm(), p.sly_mm(), p.slz_mm()};
  out.covariance_mm2 = {square(p.sx_mm()), p.cxy_mm2(),       p.cxz_mm2(),
                        p.cxy_mm2(),       square(p.sy_mm()), p.cyz_mm2(),
                        p.cxz_mm2(),       p.cyz_mm2(),       square(p.sz_mm())};
  out.rotation_deg = {to_deg(p.rx_rad()), to_deg(p.ry_rad()), to_deg(p.rz_rad())};
  if (!std::isnan(p.srx_rad()))
    out.rotation_stddev_deg = {to_deg(p.srx_rad()), to_deg(p.sry_rad()), to_deg(p.srz_rad())};
  out.in_domain = p.in_domain();
  out.bias_share = p.bias_share();
  return out;
}

CorrectedTarget to_wire(const exchange::CorrectedTarget& correction, const exchange::Rails& rails) {
  CorrectedTarget out;
  out.status(status_called(correction.status));
  out.commanded(to_wire(correction.commanded));
  out.joints_rad(joints_on_wire(correction.joints_deg, rails));
  out.error_before_mm(correction.error_before_mm);
  out.error_after_mm(correction.error_after_mm);
  out.sigma_mm(correction.sigma_mm);
  out.sigma_measured_mm(correction.sigma_measured_mm);
  out.turn_before_rad(rad_of(correction.turn_before_deg));
  out.turn_after_rad(rad_of(correction.turn_after_deg));
  out.iterations(correction.iterations);
  out.message(correction.message);
  return out;
}

exchange::CorrectedTarget from_wire(const CorrectedTarget& correction,
                                    const exchange::Rails& rails) {
  return {word_of(correction.status()),
          from_wire(correction.commanded()),
          joints_in_degrees(correction.joints_rad(), rails),
          correction.error_before_mm(),
          correction.error_after_mm(),
          correction.sigma_mm(),
          correction.sigma_measured_mm(),
          to_deg(correction.turn_before_rad()),
          to_deg(correction.turn_after_rad()),
          correction.iterations(),
          correction.message()};
}

}  // namespace trammel::wire
