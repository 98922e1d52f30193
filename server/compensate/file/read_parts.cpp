#include "server/compensate/file/read_parts.h"

#include <algorithm>

#include "server/bias/kernels/kernel_spelling.h"
#include "server/compensate/file/budget_values.h"
#include "server/compensate/file/json_values.h"
#include "server/compensate/file/keys.h"

namespace trammel::model_file {

namespace {

std::optional<double> number_if(const Json& json, const char* key) {
  if (!json.contains(key)) return std::nullopt;
  return number_from(json, key);
}

ErrorFigures figures_from(const Json& json) {
  ErrorFigures f;
  f.rms = number_from(json, "rms_m");
  f.mean = number_from(json, "mean_m");
  f.p997 = number_from(json, "p997_m");
  f.max = number_from(json, "max_m");
  f.axis_mean = vector3_from(json.at("axis_mean_m"));
  f.axis_stddev = vector3_from(json.at("axis_stddev_m"));
  return f;
}

OrientationFigures orientation_from(const Json& json) {
  return {.poses = count_from(json, "poses"),
          .nominal = number_from(json, "nominal_rad"),
          .calibrated = number_from(json, "calibrated_rad"),
          .compensated = number_from(json, "compensated_rad"),
          .coverage_95 = number_if(json, "coverage_95")};
}

GaugeFigures gauges_from(const Json& json) {
  return {count_from(json, "rows"),          number_from(json, "nominal_m"),
          number_from(json, "calibrated_m"), number_from(json, "compensated_m"),
          number_from(json, "max_m"),        number_from(json, "coverage_95"),
          count_from(json, "in_domain"),     number_if(json, "coverage_95_stated")};
}

Evaluation evaluation_from(const Json& json) {
  Evaluation e;
  e.poses = count_from(json, "poses");
  if (json.contains("gauges")) e.gauges = gauges_from(json.at("gauges"));
  if (e.poses == 0 && e.gauges) {
    e.nominal = e.calibrated = e.compensated = no_figures();
    e.coverage_95 = std::numeric_limits<double>::quiet_NaN();
    return e;
  }
  e.nominal = figures_from(json.at("nominal"));
  e.calibrated = figures_from(json.at("calibrated"));
  e.compensated = figures_from(json.at("compensated"));
  e.coverage_95 = number_from(json, "coverage_95");
  e.in_domain = count_from(json, "in_domain");
  e.nlpd = number_if(json, "nlpd_of_m");
  e.bias_gain_z = number_if(json, "bias_gain_z");
  e.coverage_95_stated = number_if(json, "coverage_95_stated");
  if (json.contains("orientation")) e.orientation = orientation_from(json.at("orientation"));
  return e;
}

BiasState bias_from(const Json& json) {
  BiasState bias;
  bias.kernel = json.at("kernel");
  bias.q = matrix_from(json.at("q"));
  bias.residual_B = matrix_from(json.at("residual_B"));
  bias.sigma = vector_from(json.at("sigma"));
  bias.offset = vector_from(json.at("offset"));
  bias.hyperparameters = matrix_from(json.at("hyperparameters"));
  if (json.contains("block_hyperparameters")) {
    bias.block_hyperparameters = vector_from(json.at("block_hyperparameters"));
  }
  return bias;
}

PoseContext context_from(const Json& json) {
  PoseContext context;
  context.tool = json.at("tool");
  context.payload = json.at("payload");
  context.index = whole_from<int>(json, "index");
  context.time = number_if(json, "time_s");
  context.temperature = number_if(json, "temperature_c");
  if (json.contains("velocity")) context.velocity = vector_from(json.at("velocity"));
  if (json.contains("direction")) {
    for (const Json& one : list_from(json.at("direction")))
      context.direction.push_back(whole_from<int>(one));
  }
  if (json.contains("before")) context.before = vector_from(json.at("before"));
  if (json.contains("lagged_c")) {
    for (const Json& one : list_from(json.at("lagged_c")))
      context.lagged.push_back(number_from(one));
  }
  return context;
}

BiasChoice choice_from(const Json& json) {
  BiasChoice choice{.kernel = json.at("kernel"), .candidates = {}, .sentence = json.at("sentence")};
  for (const Json& c : list_from(json.at("candidates"))) {
    choice.candidates.push_back({.kernel = c.at("kernel"),
                                 .leave_one_out_rms = number_from(c, "leave_one_out_rms_m"),
                                 .leave_one_out_nlpd = number_from(c, "leave_one_out_nlpd_of_m"),
                                 .time_block_rms = number_from(c, "time_block_rms_m"),
                                 .joint_block_rms = number_from(c, "joint_block_rms_m"),
                                 .gain = number_from(c, "gain_m2"),
                                 .gain_stddev = number_from(c, "gain_stddev_m2"),
                                 .verdict = c.at("verdict"),
                                 .skipped = c.contains("skipped") && truth_from(c.at("skipped"))});
  }
  return choice;
}

CauseChoice causes_from(const Json& json) {
  CauseChoice choice{.held_out = number_from(json, "held_out_m"), .tried = {}};
  for (const Json& one : list_from(json.at("tried"))) {
    choice.tried.push_back({.sources = one.at("sources").get<std::vector<std::string>>(),
                            .held_out_before = number_from(one, "held_out_before_m"),
                            .held_out_after = number_from(one, "held_out_after_m"),
                            .gain = number_from(one, "gain_nat"),
                            .freedom = number_from(one, "freedom"),
                            .taken = truth_from(one.at("taken")),
                            .why = one.at("why")});
  }
  return choice;
}

RefitRecord refit_from(const Json& json) {
  return {.model = json.at("model"),
          .sources = json.at("sources").get<std::vector<std::string>>(),
          .batch_id = json.at("batch_id"),
          .batch_hash = json.at("batch_hash"),
          .poses = count_from(json, "poses")};
}

SessionSetting session_from(const Json& json) {
  SessionSetting session;
  session.id = json.at("id");
  session.first = whole_from<int>(json, "first");
  session.first_pose = json.at("first_pose");
  session.poses = count_from(json, "poses");
  session.X_WS = pose_from(json.at("X_WS"));
  session.scale = number_if(json, "scale").value_or(0);
  session.own_noise = number_if(json, "own_noise_m").value_or(0);
  session.own_noise_rotation = number_if(json, "own_noise_rad").value_or(0);
  return session;
}

void read_sessions(const Json& content, ModelParts& parts) {
  if (content.contains("sessions")) {
    for (const Json& session : list_from(content.at("sessions")))
      parts.sessions.push_back(session_from(session));
  }
  parts.sessions_as_given =
      content.contains("sessions_as_given") && truth_from(content.at("sessions_as_given"));
  if (content.contains("changes")) {
    for (const Json& change : list_from(content.at("changes"))) {
      parts.changes.push_back(
          {.source = change.at("source"),
           .session = static_cast<std::size_t>(count_from(change, "session")),
           .gain = number_from(change, "gain"),
           .p_value = number_from(change, "p_value"),
           .could_also_be = change.at("could_also_be").get<std::vector<std::string>>()});
      if (!change.contains("rate_rad")) continue;
      parts.changes.back().rate = number_from(change, "rate_rad");
      parts.changes.back().steps = change.at("steps").get<std::vector<std::string>>();
    }
  }
  if (!content.contains("sessions_left_out")) return;
  for (const Json& session : list_from(content.at("sessions_left_out")))
    parts.sessions_left_out.push_back({session.at("id"), session.at("why")});
}

/// The physics of this cell with the frames and values from a file.
Result<PhysicalModel> physics_from(const Json& json, const std::shared_ptr<const Cell>& cell) {
  Result<PhysicalModel> physics =
      make_physical_model(cell, json.at("error_sources").get<std::vector<std::string>>());
  if (!physics) return physics;
  physics->X_WB = pose_from(json.at("X_WB"));
  for (auto& [name, X_FT] : physics->tools) X_FT = pose_from(json.at("tools").at(name));
  physics->values = vector_from(json.at("values"));
  return physics;
}

Result<ModelParts::BiasOrigin> origin_from(const Json& json,
                                           const std::shared_ptr<const Cell>& cell) {
  return physics_from(json, cell).map([&](PhysicalModel physics) {
    return ModelParts::BiasOrigin{std::move(physics), matrix_from(json.at("covariance"))};
  });
}

/// Named and ordered as the error sources have them.
Status read_parameters(const Json& content, const std::string& where, ModelParts& parts) {
  const std::vector<Parameter> known = parts.physics.parameters();
  const Json& parameters = list_from(content.at("parameters"));
  if (parameters.size() != known.size())
    return refused("{} parameters, expected {}", parameters.size(), known.size())
        .in(where)
        .of("parameters")
        .beyond(parameters.size(), known.size());
  for (std::size_t i = 0; i < known.size(); ++i) {
    const Json& one = parameters.at(i);
    if (one.at("name").get<std::string>() != known[i].name)
      return refused("its parameter {} is not {}, as its error sources say", i + 1, known[i].name)
          .in(where)
          .of("parameters")
          .with_text(known[i].name);
    parts.parameters.push_back({.parameter = known[i],
                                .value = number_from(one, "value"),
                                .stddev = number_from(one, "stddev"),
                                .identified = truth_from(one.at("identified"))});
    if (!one.contains("prior")) continue;
    parts.parameters.back().parameter.prior = number_from(one, "prior");
    parts.parameters.back().parameter.prior_scale = number_from(one, "prior_stddev");
    if (!(parts.parameters.back().parameter.prior_scale > 0))
      return refused("a prior of no width").in(where).of("parameters").with_text(known[i].name);
  }
  return {};
}

Status read_calibration(const Json& content, const std::string& where, ModelParts& parts) {
  parts.covariance = matrix_from(content.at("covariance"));
  TRY(read_parameters(content, where, parts));
  for (const Json& u : list_from(content.at("unidentifiable"))) {
    parts.unidentifiable.push_back({.singular_value = number_from(u, "singular_value"),
                                    .parameters = u.at("parameters"),
                                    .sentence = u.at("sentence")});
  }
  parts.rank = whole_from<int>(content, "rank");
  parts.condition_number = number_from(content, "condition_number");
  parts.observability_index = number_from(content, "observability_index");
  for (const Json& pose : list_from(content.at("suspects"))) {
    parts.suspects.push_back({.pose_id = pose.at("pose_id"),
                              .row = whole_from<int>(pose, "row"),
                              .distance = number_from(pose, "distance_m"),
                              .sigmas = number_from(pose, "sigmas")});
  }
  parts.cost_record = numbers_from(content.at("cost_record"));
  parts.discrepancy = number_from(content, "discrepancy_m");
  read_sessions(content, parts);
  return {};
}

WhatWasMeasured measured_from(const Json& json) {
  WhatWasMeasured measured;
  measured.poses = count_from(json, "poses");
  for (const Json& one : list_from(json.at("approaches")))
    measured.approaches.push_back(
        {.rising = count_from(one, "rising"), .falling = count_from(one, "falling")});
  measured.lower = vector3_from(json.at("lower_m"));
  measured.upper = vector3_from(json.at("upper_m"));
  measured.volume = number_from(json, "volume_m3");
  const Eigen::MatrixXd places = matrix_from(json.at("flange_m"));
  if (places.cols() != 3 || places.rows() < 1)
    wrong("expected places of the flange, three columns", json.at("poses"));
  measured.flange_B = places.transpose();
  measured.reach = number_if(json, "reach_m");
  if (json.contains("outline_m")) measured.outline = vector_from(json.at("outline_m"));
  measured.stated = number_if(json, "stated_m");
  if (json.contains("rounding")) {
    const Json& rounding = json.at("rounding");
    measured.rounding = {number_from(rounding, "step_m"), number_from(rounding, "sigma_m"),
                         truth_from(rounding.at("is_of_gauges"))};
  }
  if (json.contains("joint_rounding")) {
    const Json& rounding = json.at("joint_rounding");
    measured.joint_rounding = {number_from(rounding, "step_rad"),
                               number_from(rounding, "stddev_m")};
  }
  measured.one_place = json.contains("one_place") && truth_from(json.at("one_place"));
  if (json.contains("off_drawing")) measured.off_drawing = json.at("off_drawing");
  if (!json.contains("temperature_c")) return measured;
  const Json& temperature = json.at("temperature_c");
  measured.temperature = {number_from(temperature, "least"), number_from(temperature, "most")};
  return measured;
}

void read_domain(const Json& content, ModelParts& parts) {
  parts.q_min = vector_from(content.at("q_min"));
  parts.q_max = vector_from(content.at("q_max"));
  if (content.contains("measured")) parts.measured = measured_from(content.at("measured"));
  parts.prior_share_limit = number_from(content, "prior_share_limit");
  if (content.contains("bias_spread")) parts.bias_spread = number_from(content, "bias_spread");
  if (content.contains("extrapolation_slope")) {
    parts.extrapolation_slope = vector_from(content.at("extrapolation_slope"));
  }
  content.at("trained_with").get_to(parts.trained_with);
  if (content.contains("temperature_c")) {
    parts.temperature_mean = number_from(content.at("temperature_c"), "mean");
    parts.temperature_stddev = number_from(content.at("temperature_c"), "stddev");
  }
}

/// The poses of a bias with blocks.
Status read_bias_contexts(const Json& bias, const std::string& where, ModelParts& parts) {
  if (!bias.contains("poses")) return {};
  if (bias.value("fades", "") != kFades) {
    return refused(
               "its bias `{}` was learned when a bias with blocks faded as a whole beyond the "
               "domain, and would answer otherwise now",
               parts.bias->kernel)
        .in(where)
        .of("bias")
        .next("train it again");
  }
  for (const Json& context : list_from(bias.at("poses")))
    parts.bias_contexts.push_back(context_from(context));
  return {};
}

Status read_bias(const Json& content, const std::string& where, ModelParts& parts) {
  if (content.contains("cause_choice"))
    parts.cause_choice = causes_from(content.at("cause_choice"));
  if (content.contains("bias_choice")) parts.bias_choice = choice_from(content.at("bias_choice"));
  if (!content.contains("bias")) return {};
  parts.bias = bias_from(content.at("bias"));
  TRY(read_bias_contexts(content.at("bias"), where, parts));
  if (content.contains("rotation_bias"))
    parts.rotation_bias = bias_from(content.at("rotation_bias"));
  if (content.contains("bias_origin")) {
    Result<ModelParts::BiasOrigin> origin =
        origin_from(content.at("bias_origin"), parts.physics.cell);
    if (!origin) return Failure(origin.error()).as(ErrorCode::kRefused).in(where);
    parts.bias_origin = std::move(*origin);
  }
  if (content.contains("oriented_poses"))
    parts.oriented_poses = count_from(content, "oriented_poses");
  return {};
}

/// True if the cause is a function of the angle of a joint that a coupling concerns, or turns it.
bool is_of_coupled_joint(const ErrorSource& source, const Chain& robot) {
  const CauseRecord& cause = source.cause();
  const bool turns =
      cause.acts.on == causes::ActsOn::kJoints || cause.scope == causes::Scope::kJoint;
  if (!turns || cause.gives_way) return false;
  const int joint = source.joint();
  return std::any_of(robot.couplings().begin(), robot.couplings().end(),
                     [joint](const Coupling& coupling) {
                       return joint < 0 || joint == coupling.joint || joint == coupling.follows;
                     });
}

/// The learned causes of coupled joints, as the file spells them; empty where there are none.
std::string learned_of_coupled_joints(const ModelParts& parts) {
  const Chain& robot = parts.physics.cell->robot;
  const auto of_coupled = [&](const ErrorSourcePtr& source) {
    return is_of_coupled_joint(*source, robot);
  };
  const auto found =
      std::find_if(parts.physics.sources.begin(), parts.physics.sources.end(), of_coupled);
  if (found != parts.physics.sources.end()) return (*found)->name();
  const Result<SpelledBias> bias = spelled_bias(parts.bias ? parts.bias->kernel : "");
  return bias && bias->has("joint_map") && !robot.couplings().empty() ? parts.bias->kernel : "";
}

/// Refuses files from before angle causes on coupled joints changed: they used the commanded angle
/// on every arm, and files did not record this.
Status check_angles(const Json& content, const std::string& where, const ModelParts& parts) {
  if (content.value("angles", "") == kAngles) return {};
  const std::string learned = learned_of_coupled_joints(parts);
  if (learned.empty()) return {};
  return refused(
             "its `{}` was learned when causes of coupled joints followed the commanded angles and "
             "not those of the gears, and would answer otherwise now",
             learned)
      .in(where)
      .of("angles")
      .with_text(learned)
      .next("train it again");
}

ModelProvenance provenance_from(const Json& json, const Json& stamp) {
  ModelProvenance provenance;
  provenance.level = json.at("level");
  provenance.batch_id = json.at("batch_id");
  provenance.batch_hash = json.at("batch_hash");
  provenance.training_poses = count_from(json, "training_poses");
  provenance.seed = whole_from<std::uint64_t>(json, "seed");
  provenance.trained_at = whole_from<std::int64_t>(stamp, "trained_at");
  provenance.program_version = stamp.at("program_version");
  if (stamp.contains("measured_at"))
    provenance.measured_at = whole_from<std::int64_t>(stamp, "measured_at");
  if (json.contains("refits")) {
    for (const Json& refit : json.at("refits")) provenance.refits.push_back(refit_from(refit));
  }
  return provenance;
}

}  // namespace

Result<ModelParts> parts_from(const Json& content, const Json& stamp, const std::string& where) {
  Result<Cell> cell = parse_cell(content.at("cell_yaml"), content.at("robot_yaml"), where);
  if (!cell) {
    Error damaged = cell.error();
    damaged.row.reset();  // of a text inside the file
    return Failure(std::move(damaged));
  }
  Result<PhysicalModel> physics =
      physics_from(content, std::make_shared<const Cell>(std::move(*cell)));
  if (!physics) return Failure(physics.error()).as(ErrorCode::kRefused).in(where);
  ModelParts parts;
  parts.physics = std::move(*physics);
  TRY(read_calibration(content, where, parts));
  read_domain(content, parts);
  parts.training = evaluation_from(content.at("training"));
  TRY(read_bias(content, where, parts));
  TRY(check_angles(content, where, parts));
  if (content.contains("validation")) parts.validation = evaluation_from(content.at("validation"));
  if (content.contains("budget")) parts.budget = budget_from(content.at("budget"));
  parts.provenance = provenance_from(content.at("provenance"), stamp);
  return parts;
}

}  // namespace trammel::model_file
