#include "server/compensate/model_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <new>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "server/base/hash.h"
#include "server/base/json_guard.h"
#include "server/base/text_file.h"
#include "server/compensate/model_checks.h"

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

[[noreturn]] void wrong(const char* what, const Json& json) { throw Json::other_error::create(501, what, &json); }

double number_from(const Json& json) {
  if (!json.is_number() || !std::isfinite(json.get<double>())) wrong("expected a finite number", json);
  return json.get<double>();
}
double number_from(const Json& json, const char* key) { return number_from(json.at(key)); }

/// Within what `Whole` can hold.
template <typename Whole>
Whole whole_from(const Json& json) {
  if (json.is_number_unsigned()) {
    if (json.get<std::uint64_t>() <= static_cast<std::uint64_t>(std::numeric_limits<Whole>::max()))
      return json.get<Whole>();
  } else if (json.is_number_integer() && std::is_signed_v<Whole>) {
    if (json.get<std::int64_t>() >= static_cast<std::int64_t>(std::numeric_limits<Whole>::min()))
      return json.get<Whole>();
  }
  wrong("expected a whole number within its range", json);
}
template <typename Whole>
Whole whole_from(const Json& json, const char* key) {
  return whole_from<Whole>(json.at(key));
}

/// How many of something there are.
int count_from(const Json& json, const char* key) {
  const int count = whole_from<int>(json, key);
  if (count < 0) wrong("a count below 0", json);
  return count;
}

const Json& list_from(const Json& json) {
  if (!json.is_array()) wrong("expected a list", json);
  return json;
}

std::vector<double> numbers_from(const Json& json) {
  std::vector<double> numbers;
  for (const Json& one : list_from(json)) numbers.push_back(number_from(one));
  return numbers;
}

bool truth_from(const Json& json) {
  if (!json.is_boolean()) wrong("expected true or false", json);
  return json.get<bool>();
}

Eigen::MatrixXd matrix_from(const Json& json) {
  const auto rows = whole_from<Eigen::Index>(json, "rows");
  const auto columns = whole_from<Eigen::Index>(json, "columns");
  const Json& values = list_from(json.at("values"));
  const auto count = static_cast<Eigen::Index>(values.size());
  // Divided, not multiplied: a product may overflow.
  if (rows < 0 || columns < 0 ||
      (columns == 0 || rows == 0 ? count != 0 : count % rows != 0 || count / rows != columns)) {
    wrong("a matrix whose size does not fit its values", json);
  }
  Eigen::MatrixXd m(rows, columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < columns; ++j) m(i, j) = number_from(values[static_cast<std::size_t>(i * columns + j)]);
  }
  return m;
}

Eigen::VectorXd vector_from(const Json& json) {
  const Eigen::MatrixXd m = matrix_from(json);
  if (m.cols() != 1) wrong("a vector that is not one column", json);
  return m;
}

Vector3 vector3_from(const Json& json) {
  const Eigen::VectorXd v = vector_from(json);
  if (v.size() != 3) wrong("a vector that is not 3 x 1", json);
  return v;
}

Json to_json(const Pose& X) { return to_json(Eigen::MatrixXd(X.matrix().topRows<3>())); }

Pose pose_from(const Json& json) {
  const Eigen::MatrixXd m = matrix_from(json);
  if (m.rows() != 3 || m.cols() != 4) wrong("a pose that is not 3 x 4", json);
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
  f.rms = number_from(json, "rms_m");
  f.mean = number_from(json, "mean_m");
  f.p997 = number_from(json, "p997_m");
  f.max = number_from(json, "max_m");
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
  e.poses = count_from(json, "poses");
  e.nominal = figures_from(json.at("nominal"));
  e.calibrated = figures_from(json.at("calibrated"));
  e.compensated = figures_from(json.at("compensated"));
  e.coverage_95 = number_from(json, "coverage_95");
  e.in_domain = count_from(json, "in_domain");
  if (json.contains("nlpd_of_m")) e.nlpd = number_from(json, "nlpd_of_m");
  if (json.contains("bias_gain_z")) e.bias_gain_z = number_from(json, "bias_gain_z");
  if (json.contains("orientation")) {
    const Json& o = json.at("orientation");
    e.orientation = {count_from(o, "poses"),
                     number_from(o, "nominal_rad"),
                     number_from(o, "calibrated_rad"),
                     number_from(o, "compensated_rad"),
                     {}};
    if (o.contains("coverage_95")) e.orientation->coverage_95 = number_from(o, "coverage_95");
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
  context.index = whole_from<int>(json, "index");
  if (json.contains("time_s")) context.time = number_from(json, "time_s");
  if (json.contains("temperature_c")) context.temperature = number_from(json, "temperature_c");
  if (json.contains("velocity")) context.velocity = vector_from(json.at("velocity"));
  if (json.contains("direction")) {
    for (const Json& one : list_from(json.at("direction"))) context.direction.push_back(whole_from<int>(one));
  }
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
  for (const Json& c : list_from(json.at("candidates"))) {
    choice.candidates.push_back(
        {c.at("kernel"), number_from(c, "leave_one_out_rms_m"), number_from(c, "leave_one_out_nlpd_of_m"),
         number_from(c, "time_block_rms_m"), number_from(c, "joint_block_rms_m"), number_from(c, "gain_m2"),
         number_from(c, "gain_stddev_m2"), c.at("verdict"), c.contains("skipped") && truth_from(c.at("skipped"))});
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
          json.at("batch_hash"), count_from(json, "poses")};
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

Result<CompensatedModel> model_from(const Json& content, const Json& stamp, const std::string& where) {
  Result<Cell> cell = parse_cell(content.at("cell_yaml"), content.at("robot_yaml"), where);
  if (!cell) {
    Error damaged = cell.error();
    damaged.row.reset();  // of a text inside the file
    return Failure(std::move(damaged));
  }
  Result<PhysicalModel> physics = physics_from(content, std::make_shared<const Cell>(std::move(*cell)));
  if (!physics) return Failure(physics.error()).as(ErrorCode::kRefused).in(where);
  CompensatedModel::Parts parts;
  parts.physics = std::move(*physics);
  parts.covariance = matrix_from(content.at("covariance"));
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
    parts.parameters.push_back(
        {known[i], number_from(one, "value"), number_from(one, "stddev"), truth_from(one.at("identified"))});
  }
  for (const Json& u : list_from(content.at("unidentifiable"))) {
    parts.unidentifiable.push_back({number_from(u, "singular_value"), u.at("parameters"), u.at("sentence")});
  }
  parts.rank = whole_from<int>(content, "rank");
  parts.condition_number = number_from(content, "condition_number");
  parts.observability_index = number_from(content, "observability_index");
  for (const Json& pose : list_from(content.at("suspects"))) {
    parts.suspects.push_back({pose.at("pose_id"), whole_from<int>(pose, "row"), number_from(pose, "distance_m"),
                              number_from(pose, "sigmas")});
  }
  parts.cost_record = numbers_from(content.at("cost_record"));
  parts.discrepancy = number_from(content, "discrepancy_m");
  parts.q_min = vector_from(content.at("q_min"));
  parts.q_max = vector_from(content.at("q_max"));
  parts.prior_share_limit = number_from(content, "prior_share_limit");
  if (content.contains("extrapolation_slope")) {
    parts.extrapolation_slope = vector_from(content.at("extrapolation_slope"));
  }
  content.at("trained_with").get_to(parts.trained_with);
  parts.training = evaluation_from(content.at("training"));
  if (content.contains("temperature_c")) {
    parts.temperature_mean = number_from(content.at("temperature_c"), "mean");
    parts.temperature_stddev = number_from(content.at("temperature_c"), "stddev");
  }
  if (content.contains("bias_choice")) parts.bias_choice = choice_from(content.at("bias_choice"));
  if (content.contains("bias")) {
    const Json& bias = content.at("bias");
    parts.bias = bias_from(bias);
    if (bias.contains("poses")) {
      if (bias.value("fades", "") != kFades) {
        return refused(
                   "its bias `{}` was learned when a bias with blocks faded as a whole beyond the domain, and would "
                   "answer otherwise now",
                   parts.bias->kernel)
            .in(where)
            .of("bias")
            .next("train it again");
      }
      for (const Json& context : list_from(bias.at("poses"))) parts.bias_contexts.push_back(context_from(context));
    }
    if (content.contains("rotation_bias")) parts.rotation_bias = bias_from(content.at("rotation_bias"));
    if (content.contains("bias_origin")) {
      Result<CompensatedModel::Parts::BiasOrigin> origin = origin_from(content.at("bias_origin"), parts.physics.cell);
      if (!origin) return Failure(origin.error()).as(ErrorCode::kRefused).in(where);
      parts.bias_origin = std::move(*origin);
    }
    if (content.contains("oriented_poses")) parts.oriented_poses = count_from(content, "oriented_poses");
  }
  if (content.contains("validation")) parts.validation = evaluation_from(content.at("validation"));
  const Json& provenance = content.at("provenance");
  parts.provenance.level = provenance.at("level");
  parts.provenance.batch_id = provenance.at("batch_id");
  parts.provenance.batch_hash = provenance.at("batch_hash");
  parts.provenance.training_poses = count_from(provenance, "training_poses");
  parts.provenance.seed = whole_from<std::uint64_t>(provenance, "seed");
  parts.provenance.trained_at = whole_from<std::int64_t>(stamp, "trained_at");
  parts.provenance.program_version = stamp.at("program_version");
  if (stamp.contains("measured_at")) parts.provenance.measured_at = whole_from<std::int64_t>(stamp, "measured_at");
  if (provenance.contains("refits")) {
    for (const Json& refit : provenance.at("refits")) parts.provenance.refits.push_back(refit_from(refit));
  }
  const Status possible = check_parts(parts);
  Result<CompensatedModel> model =
      possible ? CompensatedModel::make(std::move(parts)) : tl::make_unexpected(possible.error());
  return std::move(model).map_error([&](Error error) { return Failure(std::move(error)).in(where).value(); });
}

}  // namespace

std::string content_hash(const CompensatedModel::Parts& parts) { return sha256_hex(content_of(parts).dump()); }

std::string serialize(const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  Json stamp = {{"trained_at", provenance.trained_at}, {"program_version", provenance.program_version}};
  if (provenance.measured_at) stamp["measured_at"] = *provenance.measured_at;
  const Json file = {{"trammel_model", kFormat},
                     {"hash", provenance.hash},
                     {"stamp", stamp},
                     {"stamp_hash", sha256_hex(stamp.dump())},
                     {"content", content_of(model.parts())}};
  // Its last byte closes the object: whatever is cut off is missed.
  return file.dump();
}

namespace {

using Members = std::map<std::string, std::string_view>;

/// For a message: short, and nothing that a terminal would obey.
std::string shown(std::string_view text) {
  std::string plain(text.substr(0, 120));
  std::replace_if(
      plain.begin(), plain.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return plain;
}

/// The outermost keys, and no others: a damaged key is not one that is missing.
Status check_keys(const Members& members, const std::string& where) {
  static constexpr std::array<std::string_view, 5> kKeys = {"content", "hash", "stamp", "trammel_model", "stamp_hash"};
  for (const auto& [key, value] : members) {
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
      return refused("not a Trammel model: unknown key {}", shown(key)).in(where).of(shown(key));
  }
  // Models of before the stamp was hashed have no stamp_hash.
  for (const std::string_view key : kKeys) {
    if (key != "stamp_hash" && !members.contains(std::string(key)))
      return refused("not a Trammel model: no {}", key).in(where).of(std::string(key));
  }
  const std::string_view format = members.at("trammel_model");
  if (format == std::to_string(kFormat)) return {};
  return refused("model format {}, this program reads {}", shown(format), kFormat)
      .in(where)
      .of("trammel_model")
      .with_text(shown(format));
}

/// Of the bytes as they stand in the file.
Status check_hash(const Members& members, const std::string& of, const std::string& by, const std::string& where) {
  const std::string hash = sha256_hex(members.at(of));
  if (members.at(by) == '"' + hash + '"') return {};
  return refused("damaged: its {} is {}, its {} has {}", by, shown(members.at(by)), of, hash).in(where).of(by);
}

Result<CompensatedModel> checked_model(const Members& members, const std::string& where) {
  Status fine = check_keys(members, where);
  if (fine) fine = check_hash(members, "content", "hash", where);
  if (fine && members.contains("stamp_hash")) fine = check_hash(members, "stamp", "stamp_hash", where);
  if (!fine) return tl::make_unexpected(fine.error());
  return model_from(Json::parse(members.at("content")), Json::parse(members.at("stamp")), where);
}

}  // namespace

Result<CompensatedModel> deserialize(const std::string& text, const std::string& where) {
  try {
    return json_members(text, where).and_then([&](const Members& members) { return checked_model(members, where); });
  } catch (const Json::exception& error) {
    return refused("not a Trammel model: {}", shown(error.what())).in(where);
  } catch (const std::bad_alloc&) {
    return failure(ErrorCode::kTooLarge, "its {} bytes ask for more memory than there is", text.size())
        .in(where)
        .with_value(text.size());
  }
}

Result<CompensatedModel> load_model(const std::string& path) {
  return read_text_file(path).and_then([&](const std::string& text) { return deserialize(text, path); });
}

}  // namespace trammel
