#include "server/compensate/model_file.h"

#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "server/base/text_file.h"

namespace trammel {

namespace {

using Json = nlohmann::json;

constexpr int kFormat = 1;
constexpr const char* kFades = "kernel";  // beyond the domain, of a bias with blocks

Json to_json(const Eigen::MatrixXd& m) {
  Json values = Json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) values.push_back(m(i, j));
  }
  return {{"rows", m.rows()}, {"columns", m.cols()}, {"values", std::move(values)}};
}

Eigen::MatrixXd matrix_from(const Json& json) {
  const auto rows = json.at("rows").get<Eigen::Index>();
  const auto columns = json.at("columns").get<Eigen::Index>();
  const Json& values = json.at("values");
  const auto count = static_cast<Eigen::Index>(values.size());
  // Divided, not multiplied: a product may overflow.
  if (rows < 0 || columns < 0 ||
      (columns == 0 || rows == 0 ? count != 0 : count % rows != 0 || count / rows != columns)) {
    throw Json::other_error::create(501, "a matrix whose size does not fit its values", &json);
  }
  Eigen::MatrixXd m(rows, columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < columns; ++j)
      m(i, j) = values[static_cast<std::size_t>(i * columns + j)].get<double>();
  }
  return m;
}

Eigen::VectorXd vector_from(const Json& json) {
  const Eigen::MatrixXd m = matrix_from(json);
  if (m.cols() != 1) throw Json::other_error::create(501, "a vector that is not one column", &json);
  return m;
}

Vector3 vector3_from(const Json& json) {
  const Eigen::VectorXd v = vector_from(json);
  if (v.size() != 3) throw Json::other_error::create(501, "a vector that is not 3 x 1", &json);
  return v;
}

Json to_json(const Pose& X) { return to_json(Eigen::MatrixXd(X.matrix().topRows<3>())); }

Pose pose_from(const Json& json) {
  const Eigen::MatrixXd m = matrix_from(json);
  if (m.rows() != 3 || m.cols() != 4) throw Json::other_error::create(501, "a pose that is not 3 x 4", &json);
  Pose X = Pose::Identity();
  X.matrix().topRows<3>() = m;
  return X;
}

Json to_json(const ErrorFigures& f) {
  return {{"rms_m", f.rms},
          {"mean_m", f.mean},
          {"p997_m", f.p997},
          {"max_m", f.max},
          {"axis_mean_m", to_json(Eigen::MatrixXd(f.axis_mean))},
          {"axis_stddev_m", to_json(Eigen::MatrixXd(f.axis_stddev))}};
}

ErrorFigures figures_from(const Json& json) {
  ErrorFigures f;
  f.rms = json.at("rms_m");
  f.mean = json.at("mean_m");
  f.p997 = json.at("p997_m");
  f.max = json.at("max_m");
  f.axis_mean = vector3_from(json.at("axis_mean_m"));
  f.axis_stddev = vector3_from(json.at("axis_stddev_m"));
  return f;
}

Json to_json(const Evaluation& e) {
  Json json = {{"poses", e.poses},
               {"nominal", to_json(e.nominal)},
               {"calibrated", to_json(e.calibrated)},
               {"compensated", to_json(e.compensated)},
               {"coverage_95", e.coverage_95},
               {"in_domain", e.in_domain}};
  if (e.nlpd) json["nlpd_of_m"] = *e.nlpd;
  if (e.bias_gain_z) json["bias_gain_z"] = *e.bias_gain_z;
  if (e.orientation) {
    json["orientation"] = {{"poses", e.orientation->poses},
                           {"nominal_rad", e.orientation->nominal},
                           {"calibrated_rad", e.orientation->calibrated},
                           {"compensated_rad", e.orientation->compensated}};
    if (e.orientation->coverage_95) json["orientation"]["coverage_95"] = *e.orientation->coverage_95;
  }
  return json;
}

Evaluation evaluation_from(const Json& json) {
  Evaluation e;
  e.poses = json.at("poses");
  e.nominal = figures_from(json.at("nominal"));
  e.calibrated = figures_from(json.at("calibrated"));
  e.compensated = figures_from(json.at("compensated"));
  e.coverage_95 = json.at("coverage_95");
  e.in_domain = json.at("in_domain");
  if (json.contains("nlpd_of_m")) e.nlpd = json.at("nlpd_of_m").get<double>();
  if (json.contains("bias_gain_z")) e.bias_gain_z = json.at("bias_gain_z").get<double>();
  if (json.contains("orientation")) {
    const Json& o = json.at("orientation");
    e.orientation = {o.at("poses"), o.at("nominal_rad"), o.at("calibrated_rad"), o.at("compensated_rad"), {}};
    if (o.contains("coverage_95")) e.orientation->coverage_95 = o.at("coverage_95").get<double>();
  }
  return e;
}

Json to_json(const BiasState& bias) {
  Json json = {{"kernel", bias.kernel},
               {"q", to_json(bias.q)},
               {"residual_B", to_json(bias.residual_B)},
               {"sigma", to_json(Eigen::MatrixXd(bias.sigma))},
               {"offset", to_json(Eigen::MatrixXd(bias.offset))},
               {"hyperparameters", to_json(bias.hyperparameters)}};
  if (bias.block_hyperparameters.size() > 0) {
    json["block_hyperparameters"] = to_json(Eigen::MatrixXd(bias.block_hyperparameters));
  }
  return json;
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

/// Of one observation of a bias with blocks: all but its joints, and only what was recorded.
Json to_json(const PoseContext& context) {
  Json json = {{"tool", context.tool}, {"payload", context.payload}, {"index", context.index}};
  if (context.time) json["time_s"] = *context.time;
  if (context.temperature) json["temperature_c"] = *context.temperature;
  if (context.velocity) json["velocity"] = to_json(Eigen::MatrixXd(*context.velocity));
  if (!context.direction.empty()) json["direction"] = context.direction;
  return json;
}

PoseContext context_from(const Json& json) {
  PoseContext context;
  context.tool = json.at("tool");
  context.payload = json.at("payload");
  context.index = json.at("index");
  if (json.contains("time_s")) context.time = json.at("time_s").get<double>();
  if (json.contains("temperature_c")) context.temperature = json.at("temperature_c").get<double>();
  if (json.contains("velocity")) context.velocity = vector_from(json.at("velocity"));
  if (json.contains("direction")) json.at("direction").get_to(context.direction);
  return context;
}

Json to_json(const BiasChoice& choice) {
  Json candidates = Json::array();
  for (const BiasCandidate& c : choice.candidates) {
    candidates.push_back({{"kernel", c.kernel},
                          {"leave_one_out_rms_m", c.leave_one_out_rms},
                          {"leave_one_out_nlpd_of_m", c.leave_one_out_nlpd},
                          {"time_block_rms_m", c.time_block_rms},
                          {"joint_block_rms_m", c.joint_block_rms},
                          {"gain_m2", c.gain},
                          {"gain_stddev_m2", c.gain_stddev},
                          {"verdict", c.verdict}});
    if (c.skipped) candidates.back()["skipped"] = true;
  }
  return {{"kernel", choice.kernel}, {"sentence", choice.sentence}, {"candidates", std::move(candidates)}};
}

BiasChoice choice_from(const Json& json) {
  BiasChoice choice{json.at("kernel"), {}, json.at("sentence")};
  for (const Json& c : json.at("candidates")) {
    choice.candidates.push_back({c.at("kernel"), c.at("leave_one_out_rms_m"), c.at("leave_one_out_nlpd_of_m"),
                                 c.at("time_block_rms_m"), c.at("joint_block_rms_m"), c.at("gain_m2"),
                                 c.at("gain_stddev_m2"), c.at("verdict"), c.value("skipped", false)});
  }
  return choice;
}

Json to_json(const RefitRecord& refit) {
  return {{"model", refit.model},
          {"sources", refit.sources},
          {"batch_id", refit.batch_id},
          {"batch_hash", refit.batch_hash},
          {"poses", refit.poses}};
}

RefitRecord refit_from(const Json& json) {
  return {json.at("model"), json.at("sources").get<std::vector<std::string>>(), json.at("batch_id"),
          json.at("batch_hash"), json.at("poses")};
}

Json frames_of(const PhysicalModel& physics) {
  Json tools = Json::object();
  for (const auto& [name, X_FT] : physics.tools) tools[name] = to_json(X_FT);
  return tools;
}

Json names_of(const PhysicalModel& physics) {
  Json sources = Json::array();
  for (const ErrorSourcePtr& source : physics.sources) sources.push_back(source->name());
  return sources;
}

Json to_json(const CompensatedModel::Parts::BiasOrigin& origin) {
  return {{"X_WB", to_json(origin.physics.X_WB)},
          {"tools", frames_of(origin.physics)},
          {"error_sources", names_of(origin.physics)},
          {"values", to_json(Eigen::MatrixXd(origin.physics.values))},
          {"covariance", to_json(origin.covariance)}};
}

/// The physics of this cell with the frames and values that a file gives.
Result<PhysicalModel> physics_from(const Json& json, const std::shared_ptr<const Cell>& cell) {
  Result<PhysicalModel> physics = make_physical_model(cell, json.at("error_sources").get<std::vector<std::string>>());
  if (!physics) return physics;
  physics->X_WB = pose_from(json.at("X_WB"));
  for (auto& [name, X_FT] : physics->tools) X_FT = pose_from(json.at("tools").at(name));
  physics->values = vector_from(json.at("values"));
  return physics;
}

Result<CompensatedModel::Parts::BiasOrigin> origin_from(const Json& json, const std::shared_ptr<const Cell>& cell) {
  return physics_from(json, cell).map([&](PhysicalModel physics) {
    return CompensatedModel::Parts::BiasOrigin{std::move(physics), matrix_from(json.at("covariance"))};
  });
}

/// All but the stamp.
Json content_of(const CompensatedModel::Parts& parts) {
  const PhysicalModel& physics = parts.physics;
  Json parameters = Json::array();
  for (const IdentifiedParameter& p : parts.parameters) {
    parameters.push_back(
        {{"name", p.parameter.name}, {"value", p.value}, {"stddev", p.stddev}, {"identified", p.identified}});
  }
  Json unidentifiable = Json::array();
  for (const UnidentifiableCombination& u : parts.unidentifiable) {
    unidentifiable.push_back(
        {{"singular_value", u.singular_value}, {"parameters", u.parameters}, {"sentence", u.sentence}});
  }
  Json suspects = Json::array();
  for (const SuspectPose& pose : parts.suspects) {
    suspects.push_back(
        {{"pose_id", pose.pose_id}, {"row", pose.row}, {"distance_m", pose.distance}, {"sigmas", pose.sigmas}});
  }
  Json content = {{"cell_yaml", physics.cell->cell_yaml},
                  {"robot_yaml", physics.cell->robot_yaml},
                  {"X_WB", to_json(physics.X_WB)},
                  {"tools", frames_of(physics)},
                  {"error_sources", names_of(physics)},
                  {"values", to_json(Eigen::MatrixXd(physics.values))},
                  {"covariance", to_json(parts.covariance)},
                  {"parameters", std::move(parameters)},
                  {"unidentifiable", std::move(unidentifiable)},
                  {"rank", parts.rank},
                  {"condition_number", parts.condition_number},
                  {"observability_index", parts.observability_index},
                  {"suspects", std::move(suspects)},
                  {"cost_record", parts.cost_record},
                  {"discrepancy_m", parts.discrepancy},
                  {"q_min", to_json(Eigen::MatrixXd(parts.q_min))},
                  {"q_max", to_json(Eigen::MatrixXd(parts.q_max))},
                  {"prior_share_limit", parts.prior_share_limit},
                  {"trained_with", parts.trained_with},
                  {"training", to_json(parts.training)},
                  {"provenance",
                   {{"level", parts.provenance.level},
                    {"batch_id", parts.provenance.batch_id},
                    {"batch_hash", parts.provenance.batch_hash},
                    {"training_poses", parts.provenance.training_poses},
                    {"seed", parts.provenance.seed}}}};
  if (parts.extrapolation_slope.size() > 0) {
    content["extrapolation_slope"] = to_json(Eigen::MatrixXd(parts.extrapolation_slope));
  }
  if (parts.temperature_mean) {
    content["temperature_c"] = {{"mean", *parts.temperature_mean}, {"stddev", parts.temperature_stddev}};
  }
  if (parts.bias_choice) content["bias_choice"] = to_json(*parts.bias_choice);
  if (parts.bias) {
    content["bias"] = to_json(*parts.bias);
    for (const PoseContext& context : parts.bias_contexts) content["bias"]["poses"].push_back(to_json(context));
    if (!parts.bias_contexts.empty()) content["bias"]["fades"] = kFades;
    if (parts.rotation_bias) content["rotation_bias"] = to_json(*parts.rotation_bias);
    if (parts.oriented_poses > 0) content["oriented_poses"] = parts.oriented_poses;
    if (parts.bias_origin) content["bias_origin"] = to_json(*parts.bias_origin);
  }
  if (parts.validation) content["validation"] = to_json(*parts.validation);
  for (const RefitRecord& refit : parts.provenance.refits) content["provenance"]["refits"].push_back(to_json(refit));
  return content;
}

Result<CompensatedModel> model_from(const Json& file, const std::string& where) {
  if (file.at("trammel_model").get<int>() != kFormat) {
    return refused("{}: model format {}, this program reads {}", where, file.at("trammel_model").dump(), kFormat);
  }
  const Json& content = file.at("content");
  const std::string hash = sha256_hex(content.dump());
  if (hash != file.at("hash").get<std::string>()) {
    return refused("{}: damaged: its hash is {}, its content has {}", where, file.at("hash").dump(), hash);
  }
  Result<Cell> cell = parse_cell(content.at("cell_yaml"), content.at("robot_yaml"), where);
  if (!cell) return tl::make_unexpected(cell.error());
  Result<PhysicalModel> physics = physics_from(content, std::make_shared<const Cell>(std::move(*cell)));
  if (!physics) return refused("{}: {}", where, physics.error().message);
  CompensatedModel::Parts parts;
  parts.physics = std::move(*physics);
  parts.covariance = matrix_from(content.at("covariance"));
  const std::vector<Parameter> known = parts.physics.parameters();
  const Json& parameters = content.at("parameters");
  if (parameters.size() != known.size())
    return refused("{}: {} parameters, expected {}", where, parameters.size(), known.size());
  for (std::size_t i = 0; i < known.size(); ++i) {
    parts.parameters.push_back(
        {known[i], parameters[i].at("value"), parameters[i].at("stddev"), parameters[i].at("identified")});
  }
  for (const Json& u : content.at("unidentifiable")) {
    parts.unidentifiable.push_back({u.at("singular_value"), u.at("parameters"), u.at("sentence")});
  }
  parts.rank = content.at("rank");
  parts.condition_number = content.at("condition_number");
  parts.observability_index = content.at("observability_index");
  for (const Json& pose : content.at("suspects")) {
    parts.suspects.push_back({pose.at("pose_id"), pose.at("row"), pose.at("distance_m"), pose.at("sigmas")});
  }
  content.at("cost_record").get_to(parts.cost_record);
  parts.discrepancy = content.at("discrepancy_m");
  parts.q_min = vector_from(content.at("q_min"));
  parts.q_max = vector_from(content.at("q_max"));
  parts.prior_share_limit = content.at("prior_share_limit");
  if (content.contains("extrapolation_slope")) {
    parts.extrapolation_slope = vector_from(content.at("extrapolation_slope"));
  }
  content.at("trained_with").get_to(parts.trained_with);
  parts.training = evaluation_from(content.at("training"));
  if (content.contains("temperature_c")) {
    parts.temperature_mean = content.at("temperature_c").at("mean").get<double>();
    parts.temperature_stddev = content.at("temperature_c").at("stddev");
  }
  if (content.contains("bias_choice")) parts.bias_choice = choice_from(content.at("bias_choice"));
  if (content.contains("bias")) {
    const Json& bias = content.at("bias");
    parts.bias = bias_from(bias);
    if (bias.contains("poses")) {
      if (bias.value("fades", "") != kFades) {
        return refused(
            "{}: its bias `{}` was learned when a bias with blocks faded as a whole beyond the domain, and would "
            "answer "
            "otherwise now: train it again",
            where, parts.bias->kernel);
      }
      for (const Json& context : bias.at("poses")) parts.bias_contexts.push_back(context_from(context));
    }
    if (content.contains("rotation_bias")) parts.rotation_bias = bias_from(content.at("rotation_bias"));
    if (content.contains("bias_origin")) {
      Result<CompensatedModel::Parts::BiasOrigin> origin = origin_from(content.at("bias_origin"), parts.physics.cell);
      if (!origin) return refused("{}: {}", where, origin.error().message);
      parts.bias_origin = std::move(*origin);
    }
    if (content.contains("oriented_poses")) parts.oriented_poses = content.at("oriented_poses");
  }
  if (content.contains("validation")) parts.validation = evaluation_from(content.at("validation"));
  const Json& provenance = content.at("provenance");
  parts.provenance.level = provenance.at("level");
  parts.provenance.batch_id = provenance.at("batch_id");
  parts.provenance.batch_hash = provenance.at("batch_hash");
  parts.provenance.training_poses = provenance.at("training_poses");
  parts.provenance.seed = provenance.at("seed");
  parts.provenance.trained_at = file.at("stamp").at("trained_at");
  if (provenance.contains("refits")) {
    for (const Json& refit : provenance.at("refits")) parts.provenance.refits.push_back(refit_from(refit));
  }
  parts.provenance.program_version = file.at("stamp").at("program_version");
  return CompensatedModel::make(std::move(parts)).map_error([&](Error error) {
    error.message = where + ": " + error.message;
    return error;
  });
}

}  // namespace

std::string content_hash(const CompensatedModel::Parts& parts) { return sha256_hex(content_of(parts).dump()); }

std::string serialize(const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  const Json file = {
      {"trammel_model", kFormat},
      {"hash", provenance.hash},
      {"stamp", {{"trained_at", provenance.trained_at}, {"program_version", provenance.program_version}}},
      {"content", content_of(model.parts())}};
  return file.dump() + "\n";
}

Result<CompensatedModel> deserialize(const std::string& text, const std::string& where) {
  try {
    return model_from(Json::parse(text), where);
  } catch (const Json::exception& error) {
    return refused("{}: not a Trammel model: {}", where, error.what());
  }
}

Result<CompensatedModel> load_model(const std::string& path) {
  return read_text_file(path).and_then([&](const std::string& text) { return deserialize(text, path); });
}

}  // namespace trammel
