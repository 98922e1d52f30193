#include "server/compensate/file/write_parts.h"

#include "server/base/hash.h"
#include "server/compensate/file/budget_values.h"
#include "server/compensate/file/json_values.h"
#include "server/compensate/file/keys.h"

namespace trammel::model_file {

namespace {

Json json_of(const ErrorFigures& f) {
  return {{"rms_m", f.rms},
          {"mean_m", f.mean},
          {"p997_m", f.p997},
          {"max_m", f.max},
          {"axis_mean_m", matrix_json(f.axis_mean)},
          {"axis_stddev_m", matrix_json(f.axis_stddev)}};
}

Json json_of(const OrientationFigures& o) {
  Json json = {{"poses", o.poses},
               {"nominal_rad", o.nominal},
               {"calibrated_rad", o.calibrated},
               {"compensated_rad", o.compensated}};
  if (o.coverage_95) json["coverage_95"] = *o.coverage_95;
  return json;
}

Json json_of(const GaugeFigures& g) {
  Json json = {{"rows", g.rows},
               {"nominal_m", g.nominal},
               {"calibrated_m", g.calibrated},
               {"compensated_m", g.compensated},
               {"max_m", g.max},
               {"coverage_95", g.coverage_95},
               {"in_domain", g.in_domain}};
  if (g.coverage_95_stated) json["coverage_95_stated"] = *g.coverage_95_stated;
  return json;
}

Json json_of(const Evaluation& e) {
  if (e.poses == 0 && e.gauges) return {{"poses", 0}, {"gauges", json_of(*e.gauges)}};
  Json json = {{"poses", e.poses},
               {"nominal", json_of(e.nominal)},
               {"calibrated", json_of(e.calibrated)},
               {"compensated", json_of(e.compensated)},
               {"coverage_95", e.coverage_95},
               {"in_domain", e.in_domain}};
  if (e.nlpd) json["nlpd_of_m"] = *e.nlpd;
  if (e.bias_gain_z) json["bias_gain_z"] = *e.bias_gain_z;
  if (e.coverage_95_stated) json["coverage_95_stated"] = *e.coverage_95_stated;
  if (e.orientation) json["orientation"] = json_of(*e.orientation);
  if (e.gauges) json["gauges"] = json_of(*e.gauges);
  return json;
}

Json json_of(const BiasState& bias) {
  Json json = {{"kernel", bias.kernel},
               {"q", matrix_json(bias.q)},
               {"residual_B", matrix_json(bias.residual_B)},
               {"sigma", matrix_json(bias.sigma)},
               {"offset", matrix_json(bias.offset)},
               {"hyperparameters", matrix_json(bias.hyperparameters)}};
  if (bias.block_hyperparameters.size() > 0)
    json["block_hyperparameters"] = matrix_json(bias.block_hyperparameters);
  return json;
}

/// One observation of a bias with blocks: all recorded values except the joints.
Json json_of(const PoseContext& context) {
  Json json = {{"tool", context.tool}, {"payload", context.payload}, {"index", context.index}};
  if (context.time) json["time_s"] = *context.time;
  if (context.temperature) json["temperature_c"] = *context.temperature;
  if (context.velocity) json["velocity"] = matrix_json(*context.velocity);
  if (!context.direction.empty()) json["direction"] = context.direction;
  if (context.before) json["before"] = matrix_json(*context.before);
  if (!context.lagged.empty()) json["lagged_c"] = context.lagged;
  return json;
}

Json json_of(const BiasCandidate& c) {
  Json json = {{"kernel", c.kernel},
               {"leave_one_out_rms_m", c.leave_one_out_rms},
               {"leave_one_out_nlpd_of_m", c.leave_one_out_nlpd},
               {"time_block_rms_m", c.time_block_rms},
               {"joint_block_rms_m", c.joint_block_rms},
               {"gain_m2", c.gain},
               {"gain_stddev_m2", c.gain_stddev},
               {"verdict", c.verdict}};
  if (c.skipped) json["skipped"] = true;
  return json;
}

Json json_of(const RefitRecord& refit) {
  return {{"model", refit.model},
          {"sources", refit.sources},
          {"batch_id", refit.batch_id},
          {"batch_hash", refit.batch_hash},
          {"poses", refit.poses}};
}

Json json_of(const IdentifiedParameter& p) {
  return {{"name", p.parameter.name},
          {"value", p.value},
          {"stddev", p.stddev},
          {"identified", p.identified}};
}

Json json_of(const UnidentifiableCombination& u) {
  return {
      {"singular_value", u.singular_value}, {"parameters", u.parameters}, {"sentence", u.sentence}};
}

Json json_of(const SuspectPose& pose) {
  return {{"pose_id", pose.pose_id},
          {"row", pose.row},
          {"distance_m", pose.distance},
          {"sigmas", pose.sigmas}};
}

Json json_of(const SessionSetting& session) {
  Json json = {{"id", session.id},
               {"first", session.first},
               {"first_pose", session.first_pose},
               {"poses", session.poses},
               {"X_WS", pose_json(session.X_WS)}};
  if (session.scale != 0) json["scale"] = session.scale;
  if (session.own_noise > 0) json["own_noise_m"] = session.own_noise;
  if (session.own_noise_rotation > 0) json["own_noise_rad"] = session.own_noise_rotation;
  return json;
}

Json json_of(const Change& change) {
  Json json = {{"source", change.source},
               {"session", change.session},
               {"gain", change.gain},
               {"p_value", change.p_value},
               {"could_also_be", change.could_also_be}};
  if (change.rate > 0) json["rate_rad"] = change.rate;
  if (change.rate > 0) json["steps"] = change.steps;
  return json;
}

Json json_of(const LeftOutSession& session) { return {{"id", session.id}, {"why", session.why}}; }

template <typename Thing>
Json list_of(const std::vector<Thing>& things) {
  Json list = Json::array();
  for (const Thing& thing : things) list.push_back(json_of(thing));
  return list;
}

Json json_of(const BiasChoice& choice) {
  return {{"kernel", choice.kernel},
          {"sentence", choice.sentence},
          {"candidates", list_of(choice.candidates)}};
}

Json json_of(const CauseChoice& choice) {
  Json tried = Json::array();
  for (const TriedCause& one : choice.tried)
    tried.push_back({{"sources", one.sources},
                     {"held_out_before_m", one.held_out_before},
                     {"held_out_after_m", one.held_out_after},
                     {"gain_nat", one.gain},
                     {"freedom", one.freedom},
                     {"taken", one.taken},
                     {"why", one.why}});
  return {{"held_out_m", choice.held_out}, {"tried", std::move(tried)}};
}

/// Frames, sources and values.
Json json_of(const PhysicalModel& physics) {
  Json tools = Json::object();
  for (const auto& [name, X_FT] : physics.tools) tools[name] = pose_json(X_FT);
  Json sources = Json::array();
  for (const ErrorSourcePtr& source : physics.sources) sources.push_back(source->name());
  return {{"X_WB", pose_json(physics.X_WB)},
          {"tools", std::move(tools)},
          {"error_sources", std::move(sources)},
          {"values", matrix_json(physics.values)}};
}

Json json_of(const ModelParts::BiasOrigin& origin) {
  Json json = json_of(origin.physics);
  json["covariance"] = matrix_json(origin.covariance);
  return json;
}

Json json_of(const ModelProvenance& provenance) {
  Json json = {{"level", provenance.level},
               {"batch_id", provenance.batch_id},
               {"batch_hash", provenance.batch_hash},
               {"training_poses", provenance.training_poses},
               {"seed", provenance.seed}};
  if (!provenance.refits.empty()) json["refits"] = list_of(provenance.refits);
  return json;
}

/// Adds the findings of the calibration.
void add_calibration(const ModelParts& parts, Json& content) {
  content["covariance"] = matrix_json(parts.covariance);
  content["parameters"] = list_of(parts.parameters);
  const std::vector<Parameter> drawn = parts.physics.parameters();
  for (std::size_t k = 0; k < drawn.size(); ++k) {
    const Parameter& used = parts.parameters[k].parameter;
    if (!(used.prior_scale < drawn[k].prior_scale)) continue;  // equal to its source's, or wider
    content["parameters"][k]["prior"] = used.prior;
    content["parameters"][k]["prior_stddev"] = used.prior_scale;
  }
  content["unidentifiable"] = list_of(parts.unidentifiable);
  content["rank"] = parts.rank;
  content["condition_number"] = parts.condition_number;
  content["observability_index"] = parts.observability_index;
  content["suspects"] = list_of(parts.suspects);
  content["cost_record"] = parts.cost_record;
  content["discrepancy_m"] = parts.discrepancy;
  if (!parts.sessions.empty()) content["sessions"] = list_of(parts.sessions);
  if (parts.sessions_as_given) content["sessions_as_given"] = true;
  if (!parts.changes.empty()) content["changes"] = list_of(parts.changes);
  if (!parts.sessions_left_out.empty())
    content["sessions_left_out"] = list_of(parts.sessions_left_out);
}

Json json_of(const WhatWasMeasured& measured) {
  Json approaches = Json::array();
  for (const auto& one : measured.approaches)
    approaches.push_back({{"rising", one.rising}, {"falling", one.falling}});
  Json json = {{"poses", measured.poses},
               {"approaches", std::move(approaches)},
               {"lower_m", matrix_json(measured.lower)},
               {"upper_m", matrix_json(measured.upper)},
               {"volume_m3", measured.volume},
               {"flange_m", matrix_json(measured.flange_B.transpose())}};
  if (measured.temperature)
    json["temperature_c"] = {{"least", measured.temperature->first},
                             {"most", measured.temperature->second}};
  if (measured.reach) json["reach_m"] = *measured.reach;
  if (measured.outline.size() > 0) json["outline_m"] = matrix_json(measured.outline);
  if (measured.stated) json["stated_m"] = *measured.stated;
  if (measured.rounding)
    json["rounding"] = {{"step_m", measured.rounding->step},
                        {"sigma_m", measured.rounding->sigma},
                        {"is_of_gauges", measured.rounding->is_of_gauges}};
  if (measured.joint_rounding)
    json["joint_rounding"] = {{"step_rad", measured.joint_rounding->step},
                              {"stddev_m", measured.joint_rounding->stddev}};
  if (measured.one_place) json["one_place"] = true;
  if (measured.off_drawing) json["off_drawing"] = *measured.off_drawing;
  return json;
}

/// Adds the region of the training poses.
void add_domain(const ModelParts& parts, Json& content) {
  content["q_min"] = matrix_json(parts.q_min);
  content["q_max"] = matrix_json(parts.q_max);
  if (parts.measured) content["measured"] = json_of(*parts.measured);
  content["prior_share_limit"] = parts.prior_share_limit;
  if (parts.bias_spread != 1) content["bias_spread"] = parts.bias_spread;
  content["trained_with"] = parts.trained_with;
  if (parts.extrapolation_slope.size() > 0)
    content["extrapolation_slope"] = matrix_json(parts.extrapolation_slope);
  if (parts.temperature_mean) {
    content["temperature_c"] = {{"mean", *parts.temperature_mean},
                                {"stddev", parts.temperature_stddev}};
  }
}

void add_bias(const ModelParts& parts, Json& content) {
  if (parts.cause_choice) content["cause_choice"] = json_of(*parts.cause_choice);
  if (parts.bias_choice) content["bias_choice"] = json_of(*parts.bias_choice);
  if (!parts.bias) return;
  content["bias"] = json_of(*parts.bias);
  if (!parts.bias_contexts.empty()) {
    content["bias"]["poses"] = list_of(parts.bias_contexts);
    content["bias"]["fades"] = kFades;
  }
  if (parts.rotation_bias) content["rotation_bias"] = json_of(*parts.rotation_bias);
  if (parts.oriented_poses > 0) content["oriented_poses"] = parts.oriented_poses;
  if (parts.bias_origin) content["bias_origin"] = json_of(*parts.bias_origin);
}

}  // namespace

Json content_of(const ModelParts& parts) {
  Json content = json_of(parts.physics);
  content["cell_yaml"] = parts.physics.cell->cell_yaml;
  content["robot_yaml"] = parts.physics.cell->robot_yaml;
  if (!parts.physics.cell->robot.couplings().empty()) content["angles"] = kAngles;
  add_calibration(parts, content);
  add_domain(parts, content);
  add_bias(parts, content);
  content["training"] = json_of(parts.training);
  if (parts.validation) content["validation"] = json_of(*parts.validation);
  if (parts.budget) content["budget"] = budget_json(*parts.budget);
  content["provenance"] = json_of(parts.provenance);
  return content;
}

Json stamp_of(const ModelProvenance& provenance) {
  Json stamp = {{"trained_at", provenance.trained_at},
                {"program_version", provenance.program_version}};
  if (provenance.measured_at) stamp["measured_at"] = *provenance.measured_at;
  return stamp;
}

std::string content_hash(const ModelParts& parts) { return sha256_hex(content_of(parts).dump()); }

}  // namespace trammel::model_file
