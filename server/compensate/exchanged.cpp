#include "server/compensate/exchanged.h"

#include "server/base/units.h"

namespace trammel {

exchange::Prediction exchanged(const ErrorPrediction& prediction) {
  using exchange::deg_from_si;
  using exchange::mm_from_si;
  exchange::Prediction out;
  out.nominal = exchange::from_si(prediction.X_BT_nominal);
  out.predicted = exchange::from_si(prediction.X_BT_predicted);
  out.error_mm = mm_from_si(prediction.error_B);
  out.stddev_mm = mm_from_si(prediction.stddev_B);
  out.true_stddev_mm = mm_from_si(prediction.true_stddev_B);
  const Matrix3 covariance_mm2 = to_mm(1) * to_mm(1) * prediction.covariance_B;
  for (int k = 0; k < 9; ++k)
    out.covariance_mm2[static_cast<std::size_t>(k)] = covariance_mm2(k / 3, k % 3);
  out.rotation_deg =
      deg_from_si(pose_difference(prediction.X_BT_predicted, prediction.X_BT_nominal).tail<3>());
  if (prediction.rotation_stddev_B)
    out.rotation_stddev_deg = deg_from_si(*prediction.rotation_stddev_B);
  out.in_domain = prediction.in_domain;
  out.bias_share = prediction.bias_weight;
  return out;
}

exchange::CorrectedTarget exchanged(const Correction& correction, const exchange::Rails& rails) {
  return {std::string(to_string(correction.status)),
          exchange::from_si(correction.X_BT_commanded),
          exchange::degrees_from_si(correction.q, rails),
          to_mm(correction.error_before),
          to_mm(correction.error_after),
          to_mm(correction.stddev),
          to_mm(correction.measured_stddev),
          to_deg(correction.turn_before),
          to_deg(correction.turn_after),
          correction.iterations,
          correction.message};
}

Target target_of(const exchange::AskedTarget& asked, const Chain& robot) {
  Target target;
  target.joint_target = asked.joint_target;
  if (!asked.joint_target) target.X_BT = exchange::to_si(asked.pose);
  target.direction = asked.approach.directions;
  target.temperature = asked.approach.temperature_c;
  target.time = asked.approach.time_s;
  target.conf = asked.conf;
  if (!asked.conf && !asked.seed_rad.empty())
    target.seed = exchange::si_from_asked(asked.seed_rad, robot);
  return target;
}

exchange::AskedTarget asked_of(const Target& target, const exchange::Rails& rails) {
  return {exchange::from_si(target.X_BT),
          target.seed ? exchange::asked_from_si(*target.seed, rails) : std::vector<double>(),
          target.conf,
          target.joint_target,
          {target.direction, target.temperature, target.time}};
}

PoseContext context_of(const exchange::AskedJoints& asked, const Chain& robot,
                       const std::string& tool, const std::string& payload) {
  PoseContext context;
  context.q = exchange::si_from_asked(asked.q_rad, robot);
  context.tool = tool;
  context.payload = payload;
  context.direction = asked.approach.directions;
  context.temperature = asked.approach.temperature_c;
  context.time = asked.approach.time_s;
  context.served = true;
  return context;
}

}  // namespace trammel
