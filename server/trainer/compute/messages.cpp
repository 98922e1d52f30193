#include "server/trainer/compute/messages.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/compensate/model_file.h"

namespace trammel::message {

namespace {

using Json = nlohmann::json;

Frame frame(const char* kind, Json head = Json::object(), std::string text = {}) {
  head["is"] = kind;
  return {std::move(head), std::move(text)};
}

/// JSON has no representation of numbers that are not finite.
void put(Json& json, const char* key, const std::optional<double>& value) {
  if (value && std::isfinite(*value)) json[key] = *value;
}

template <typename Value>
std::optional<Value> get(const Json& json, const char* key) {
  if (!json.contains(key)) return std::nullopt;
  return json.at(key).get<Value>();
}

Json json_of(const Error& error) {
  Json json = {{"code", to_text(error.code)}, {"message", error.message}, {"file", error.file},
               {"field", error.field},        {"text", error.text},       {"next", error.next},
               {"also", Json::array()}};
  if (error.row) json["row"] = *error.row;
  put(json, "value", error.value);
  put(json, "limit", error.limit);
  for (const Error& other : error.also) {
    Error alone = other;
    alone.also.clear();
    json["also"].push_back(json_of(alone));
  }
  return json;
}

Error error_from(const Json& json) {
  Error error;
  error.code = error_code_of(json.at("code").get<std::string>()).value_or(ErrorCode::kInternal);
  error.message = json.at("message");
  error.file = json.at("file");
  error.row = get<long>(json, "row");
  error.field = json.at("field");
  error.value = get<double>(json, "value");
  error.limit = get<double>(json, "limit");
  error.text = json.at("text");
  error.next = json.at("next");
  for (const Json& other : json.at("also")) error.also.push_back(error_from(other));
  return error;
}

}  // namespace

std::string kind_of(const Frame& frame) {
  const auto kind = frame.head.find("is");
  return kind != frame.head.end() && kind->is_string() ? kind->get<std::string>() : "";
}

namespace {

Json json_of(const std::optional<FleetPrior>& fleet) {
  if (!fleet) return nullptr;
  Json parameters = Json::array();
  for (const FleetParameter& one : fleet->parameters)
    parameters.push_back(
        {{"name", one.name}, {"mean", one.mean}, {"spread", one.spread}, {"robots", one.robots}});
  return {{"robot", fleet->robot}, {"robots", fleet->robots}, {"parameters", parameters}};
}

std::optional<FleetPrior> fleet_from(const Json& json) {
  if (json.is_null()) return std::nullopt;
  FleetPrior fleet;
  fleet.robot = json.at("robot");
  fleet.robots = json.at("robots");
  for (const Json& one : json.at("parameters"))
    fleet.parameters.push_back(
        {one.at("name"), one.at("mean"), one.at("spread"), one.at("robots")});
  return fleet;
}

Json json_of(const AskedJob& asked) {
  if (const auto* diagnosis = std::get_if<AskedDiagnosis>(&asked))
    return {{"is", "diagnosis"}, {"apply", diagnosis->apply}};
  if (const auto* check = std::get_if<AskedCheck>(&asked)) {
    Json json = {{"is", "check"}};
    put(json, "tolerance_m", check->tolerance);
    return json;
  }
  const auto& training = std::get<AskedTraining>(asked);
  return {{"is", "training"}, {"level", training.level}, {"bias", training.bias}};
}

AskedJob asked_from(const Json& json) {
  const std::string kind = json.at("is");
  if (kind == "diagnosis") return AskedDiagnosis{json.at("apply")};
  if (kind == "check") return AskedCheck{get<double>(json, "tolerance_m")};
  return AskedTraining{json.at("level"), json.at("bias")};
}

Json json_of(const std::vector<DriftSeen>& drifts) {
  Json list = Json::array();
  for (const DriftSeen& one : drifts)
    list.push_back({{"from", one.from}, {"until", one.until}, {"misfit", one.misfit}});
  return list;
}

std::vector<DriftSeen> drifts_from(const Json& json) {
  std::vector<DriftSeen> drifts;
  for (const Json& one : json)
    drifts.push_back(
        {one.at("from"), one.at("until"), one.at("misfit").get<std::vector<double>>()});
  return drifts;
}

}  // namespace

std::vector<Frame> of_task(const ComputeTask& task) {
  std::vector<Frame> frames;
  frames.push_back(frame("cell", {}, task.cell->cell_yaml));
  frames.push_back(frame("robot", {}, task.cell->robot_yaml));
  if (task.in_force)
    frames.push_back(frame("in_force", {{"version", task.in_force->version}}, task.in_force->text));
  frames.push_back(frame("task", {{"cell", task.cell->name},
                                  {"asked", json_of(task.asked)},
                                  {"batch_ids", task.batch_ids},
                                  {"earlier_ids", task.earlier_ids},
                                  {"earlier_checks", json_of(task.earlier_checks)},
                                  {"fleet", json_of(task.fleet)},
                                  {"hold_against_in_force", task.hold_against_in_force},
                                  {"seed", task.seed},
                                  {"validation_share", task.validation_share},
                                  {"accept_ratio", task.accept_ratio},
                                  {"now", task.now}}));
  return frames;
}

Result<ComputeTask> to_task(const Frame& frame, TaskTexts texts) {
  const Json& head = frame.head;
  auto cell =
      TRY(parse_cell(texts.cell, texts.robot, "cell " + head.at("cell").get<std::string>()));
  ComputeTask task;
  task.cell = std::make_shared<const Cell>(std::move(cell));
  task.asked = asked_from(head.at("asked"));
  task.batch_ids = head.at("batch_ids").get<std::vector<std::string>>();
  task.earlier_ids = head.at("earlier_ids").get<std::vector<std::string>>();
  task.earlier_checks = drifts_from(head.at("earlier_checks"));
  task.fleet = fleet_from(head.at("fleet"));
  task.hold_against_in_force = head.at("hold_against_in_force");
  task.in_force = std::move(texts.in_force);
  task.seed = head.at("seed");
  task.validation_share = head.at("validation_share");
  task.accept_ratio = head.at("accept_ratio");
  task.now = head.at("now");
  return task;
}

ModelText to_model_text(const Frame& frame) {
  return {frame.head.at("version").get<int>(), frame.text};
}

Frame of_batch(const BatchText& batch, bool judges) {
  return frame("batch", {{"id", batch.id}, {"taken_in", batch.taken_in}, {"judges", judges}},
               batch.csv);
}

BatchText to_batch(const Frame& frame, bool& judges) {
  judges = frame.head.at("judges");
  return {frame.head.at("id"), frame.text, frame.head.at("taken_in")};
}

Frame make() { return frame("make"); }

std::vector<Frame> of_opponents(const Opponents& opponents) {
  std::vector<Frame> frames;
  if (opponents.in_force)
    frames.push_back(
        frame("opponent", {{"version", opponents.in_force->version}}, opponents.in_force->text));
  for (const ModelText& before : opponents.served_before)
    frames.push_back(frame("served_before", {{"version", before.version}}, before.text));
  Json question = {{"most_before", opponents.most_before}};
  if (opponents.record) {
    question["record_version"] = opponents.record->version;
    question["record_rms_m"] = opponents.record->validation_rms;
  }
  frames.push_back(frame("judge", std::move(question)));
  return frames;
}

void read_opponents(const Frame& frame, Opponents& opponents) {
  opponents.most_before = frame.head.at("most_before");
  if (!frame.head.contains("record_version")) return;
  opponents.record = RecordInForce{frame.head.at("record_version"), frame.head.at("record_rms_m")};
}

Frame of_progress(const std::string& stage, double share) {
  return frame("progress", {{"stage", stage}, {"share", std::isfinite(share) ? share : 0}});
}

Frame of_findings(const std::string& findings, const std::string& page) {
  return frame("found", {{"findings_bytes", findings.size()}}, findings + page);
}

Findings to_findings(const Frame& frame) {
  const auto bytes =
      std::min(frame.head.at("findings_bytes").get<std::size_t>(), frame.text.size());
  return {frame.text.substr(0, bytes), frame.text.substr(bytes)};
}

Frame of_made(const Made& made) {
  Frame told = frame("made",
                     {{"remarks", made.remarks},
                      {"quarantine", made.quarantine},
                      {"message", made.message},
                      {"verdict", to_text(made.outcome.verdict)},
                      {"why", made.outcome.why}},
                     made.model ? serialize(*made.model) : "");
  return told;
}

Result<Made> to_made(const Frame& frame) {
  Made made;
  made.remarks = frame.head.at("remarks");
  made.quarantine = frame.head.at("quarantine");
  made.message = frame.head.at("message");
  made.outcome.verdict =
      job_verdict_of(frame.head.at("verdict").get<std::string>()).value_or(JobVerdict::kOpen);
  made.outcome.why = frame.head.at("why");
  if (frame.text.empty()) return made;
  auto model = TRY(deserialize(frame.text, "the model that was made", ModelTexts::kAsTheyAre));
  made.model = std::move(model);
  made.model_text = frame.text;
  return made;
}

Frame of_verdict(const GateVerdict& verdict) {
  Json head = {{"put_in_force", verdict.put_in_force},
               {"message", verdict.message},
               {"undecided", verdict.undecided},
               {"held_back", to_text(verdict.held_back)},
               {"why", verdict.why}};
  put(head, "before_m", verdict.figures.before);
  put(head, "after_m", verdict.figures.after);
  put(head, "limit_m", verdict.figures.limit);
  return frame("verdict", std::move(head));
}

GateVerdict to_verdict(const Frame& frame) {
  const Json& head = frame.head;
  return {
      head.at("put_in_force"),
      head.at("message"),
      head.at("undecided"),
      head.at("why"),
      {get<double>(head, "before_m"), get<double>(head, "after_m"), get<double>(head, "limit_m")},
      held_back_of(head.at("held_back").get<std::string>())};
}

Frame of_error(const Error& error, bool over_memory) {
  return frame("error", {{"error", json_of(error)}, {"over_memory", over_memory}});
}

Error to_error(const Frame& frame, bool& over_memory) {
  over_memory = frame.head.at("over_memory");
  return error_from(frame.head.at("error"));
}

}  // namespace trammel::message
