#include "server/gateway/answered.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <map>
#include <optional>
#include <utility>

#include "clients/programs/receipt_text.h"
#include "server/exchange/si.h"
#include "server/gateway/asked.h"
#include "server/gateway/programs.h"
#include "server/report/answer_json.h"
#include "server/report/error_json.h"
#include "server/report/history_json.h"
#include "server/report/note_json.h"

namespace trammel {
namespace {

using nlohmann::ordered_json;

const std::map<std::string, int> kStatusOfResult = {
    {"invalid_argument", 400}, {"unsupported", 501}, {"refused", 422}, {"not_found", 404},
    {"conflict", 409},         {"too_large", 413},   {"busy", 503},    {"out_of_resources", 503},
    {"deadline_missed", 504},  {"malformed", 400}};

int status_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return 400;
    case ErrorCode::kRefused:
      return 422;
    case ErrorCode::kNotFound:
      return 404;
    case ErrorCode::kConflict:
      return 409;
    case ErrorCode::kTooLarge:
      return 413;
    case ErrorCode::kBusy:
    case ErrorCode::kUnreachable:
      return 503;
    case ErrorCode::kInternal:
      return 500;
  }
  return 500;
}

template <typename Number>
Result<std::optional<Number>> number_option(const HttpAsk& ask, const char* name) {
  const std::string text = ask.option(name);
  if (text.empty()) return std::nullopt;
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size()) return number;
  return failure(ErrorCode::kUsage, "'{}' is no number", text).of(name).with_text(text);
}

/// Asks one thing, and turns what `ask` returns into JSON by `told`.
template <typename Ask, typename Told>
HttpReply told_by(const Ask& ask, const Told& told) {
  CallOutcome outcome;
  const auto answer = ask(outcome);
  return answer ? api_reply(200, told(*answer)) : refused_reply_of(answer.error(), outcome);
}

exchange::Rails rails_in(const GatewayAsk& ask) {
  const auto served = ask.registry.in_force(ask.route.cell);
  return served ? exchange::rails_of(served->model.cell().robot) : exchange::Rails();
}

std::vector<JointType> joint_types_in(const GatewayAsk& ask) {
  std::vector<JointType> types;
  for (const bool rail : rails_in(ask))
    types.push_back(rail ? JointType::kPrismatic : JointType::kRevolute);
  return types;
}

std::string text_in(const nlohmann::json& item, const char* name) {
  const auto found = item.find(name);
  return found != item.end() && found->is_string() ? found->get<std::string>() : std::string();
}

Result<ordered_json> predicted(const GatewayAsk& ask, CallOutcome& outcome) {
  const nlohmann::json json = TRY(read_json_object(ask.http.body));
  JsonReader body(json, "");
  body.only(
      {"poses", "tool", "payload", "model", "controller_compensates", "covariance", "orientation"});
  const CallAbout about = about_in(body, ask.route.cell);
  const MoreFigures more{body.flag("covariance"), body.flag("orientation")};
  const auto poses = TRY(poses_in(body, rails_in(ask)));
  const auto answer = TRY(ask.calls.predict(ask.from, about, poses, outcome));
  ordered_json items = ordered_json::array();
  for (std::size_t i = 0; i < answer.items.size(); ++i) {
    ordered_json& item = items.emplace_back(ordered_json::object());
    item["pose_id"] = text_in(json["poses"][i], "pose_id");
    put_figures(answer.items[i], more, item);
  }
  return ordered_json{{"model", answer.model.id},
                      {"notes", notes_json(answer.model.notes)},
                      {"predictions", items}};
}

Result<ordered_json> corrected(const GatewayAsk& ask, CallOutcome& outcome) {
  const nlohmann::json json = TRY(read_json_object(ask.http.body));
  JsonReader body(json, "");
  body.only({"targets", "tool", "payload", "model", "controller_compensates"});
  const CallAbout about = about_in(body, ask.route.cell);
  const auto targets = TRY(targets_in(body, rails_in(ask)));
  const auto answer = TRY(ask.calls.correct(ask.from, about, targets, outcome));
  const std::vector<JointType> types = joint_types_in(ask);
  ordered_json items = ordered_json::array();
  for (std::size_t i = 0; i < answer.items.size(); ++i) {
    const exchange::CorrectedTarget& target = answer.items[i];
    ordered_json& item = items.emplace_back(ordered_json::object());
    item["name"] = text_in(json["targets"][i], "name");
    item["status"] = target.status;
    item["message"] = target.message;
    put_command(target, types, item);
    put_figures(target, item);
  }
  return ordered_json{
      {"model", answer.model.id}, {"notes", notes_json(answer.model.notes)}, {"targets", items}};
}

Result<ServedModelPtr> model_for_programs(const GatewayAsk& ask) {
  if (auto served = ask.registry.in_force(ask.route.cell)) return served;
  return failure(ErrorCode::kNotFound, "cell {} has no model in force", ask.route.cell).of("cell");
}

Result<SentProgram> program_in(const std::string& text) {
  const nlohmann::json json = TRY(read_json_object(text));
  JsonReader body(json, "");
  body.only({"files", "format", "tool", "payload", "keep_digits", "frames"});
  SentProgram program;
  program.format = body.text("format");
  program.tool = body.text("tool");
  program.payload = body.text("payload");
  program.keep_digits = body.flag("keep_digits");
  program.frames = body.text("frames");
  for (const nlohmann::json& one : body.list("files")) {
    JsonReader file(one, fmt::format("file {}", program.files.size() + 1));
    file.only({"name", "base64"});
    auto bytes = from_base64(file.text("base64"));
    if (!bytes) file.refuse("base64", "Base64");
    program.files.push_back({file.text("name"), std::move(bytes).value_or("")});
    TRY(file.status());
  }
  TRY(body.status());
  return program;
}

Result<ordered_json> corrected_programs(const GatewayAsk& ask, CallOutcome& outcome) {
  auto program = TRY(program_in(ask.http.body));
  const auto served = TRY(model_for_programs(ask));
  const auto done = TRY(
      correct_sent_program(ask.calls, ask.from, *served, std::move(program), ask.version, outcome));
  ordered_json files = ordered_json::array();
  for (std::size_t k = 0; k < done.files.size(); ++k)
    files.push_back({{"name", done.corrected.files[k].name},
                     {"changed", bool{done.corrected.changed[k]}},
                     {"base64", to_base64(done.files[k])}});
  return ordered_json{
      {"model", done.corrected.model_id},
      {"files", files},
      {"summary", cam::receipt_summary(done.corrected) + cam::left_alone_text(done.corrected)},
      {"receipt", ordered_json::parse(cam::receipt_json(done.corrected, nullptr, served->notes))},
      {"receipt_csv", cam::receipt_csv(done.corrected)}};
}

/// The bytes go in and come out as they are; figures are in the headers.
HttpReply corrected_file(const GatewayAsk& ask) {
  const auto served = model_for_programs(ask);
  if (!served) return refused_reply_of(served.error());
  const HttpAsk& http = ask.http;
  SentProgram program{{{http.option("name"), http.body}},
                      http.option("format"),
                      http.option("tool"),
                      http.option("payload"),
                      http.option("keep_digits") == "true",
                      {}};
  CallOutcome outcome;
  const auto done =
      correct_sent_program(ask.calls, ask.from, **served, std::move(program), ask.version, outcome);
  if (!done) return refused_reply_of(done.error(), outcome);
  const cam::CorrectedProgram& corrected = done->corrected;
  return {200,
          "application/octet-stream",
          done->files.front(),
          {{"Trammel-Model", corrected.model_id},
           {"Trammel-Targets", std::to_string(corrected.rows.size())},
           {"Trammel-Left-Alone", std::to_string(corrected.left_alone())}}};
}

SentBatch batch_in(const HttpAsk& ask) {
  return {ask.option("change_id"), ask.option("batch_id"), ask.body};
}

Result<std::int64_t> checked(const GatewayAsk& ask, const CallAbout& about, CallOutcome& outcome) {
  const auto tolerance = TRY(number_option<double>(ask.http, "tolerance_mm"));
  return ask.calls.check(ask.from, about, batch_in(ask.http), tolerance, outcome);
}

Result<std::int64_t> trained(const GatewayAsk& ask, const CallAbout& about, CallOutcome& outcome) {
  const nlohmann::json json = TRY(read_json_object(ask.http.body));
  JsonReader body(json, "");
  body.only({"batch_ids", "level", "bias", "change_id"});
  const Training training{body.text("change_id"), body.texts("batch_ids"), body.text("level"),
                          body.text("bias")};
  TRY(body.status());
  return ask.calls.train(ask.from, about, training, outcome);
}

Result<exchange::ModelInfo> activated(const GatewayAsk& ask, const CallAbout& about,
                                      CallOutcome& outcome) {
  const nlohmann::json json = TRY(read_json_object(ask.http.body));
  JsonReader body(json, "");
  Activation change;
  if (ask.route.route->endpoint == Endpoint::kRollback) {
    body.only({"expected_version", "reason", "change_id"});
  } else {
    body.only({"version", "force", "expected_version", "reason", "change_id"});
    change.version = body.integer("version");
    if (!change.version) body.refuse("version", "a whole number");
    change.force = body.flag("force");
  }
  change.expected_version = body.integer("expected_version");
  change.reason = body.text("reason");
  change.change_id = body.text("change_id");
  TRY(body.status());
  return ask.calls.activate(ask.from, about, change, outcome);
}

Result<std::int64_t> job_number(const GatewayAsk& ask) {
  std::int64_t job = 0;
  const std::string& text = ask.route.job;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), job);
  if (error == std::errc() && end == text.data() + text.size() && job > 0) return job;
  return failure(ErrorCode::kUsage, "'{}' is no job", text).of("job").with_text(text);
}

HttpReply read_job(const GatewayAsk& ask) {
  return told_by(
      [&](CallOutcome& outcome) -> Result<std::vector<exchange::DatedJob>> {
        const auto job = TRY(job_number(ask));
        return ask.calls.jobs(ask.from, {}, job, outcome);
      },
      [](const auto& jobs) {
        return jobs.empty() ? ordered_json::object() : ordered_json(jobs_json(jobs).front());
      });
}

HttpReply read_findings(const GatewayAsk& ask) {
  CallOutcome outcome;
  const auto job = job_number(ask);
  if (!job) return refused_reply_of(job.error());
  const auto text = ask.calls.findings(ask.from, {ask.route.cell}, *job, outcome);
  return text ? HttpReply{200, "application/json", *text} : refused_reply_of(text.error(), outcome);
}

HttpReply read_status(const GatewayAsk& ask) {
  CallOutcome outcome;
  const auto text = ask.calls.fleet(ask.from, outcome);
  return text ? HttpReply{200, "application/json", *text} : refused_reply_of(text.error(), outcome);
}

/// Of a request that queues a job.
template <typename Ask>
HttpReply queued(const Ask& ask) {
  return told_by(ask, [](std::int64_t job) { return ordered_json{{"job", job}}; });
}

HttpReply answered_change(const GatewayAsk& ask) {
  const CallAbout about{ask.route.cell};
  switch (ask.route.route->endpoint) {
    case Endpoint::kSubmit:
      return queued([&](CallOutcome& outcome) {
        return ask.calls.submit(ask.from, about, batch_in(ask.http), outcome);
      });
    case Endpoint::kTrain:
      return queued([&](CallOutcome& outcome) { return trained(ask, about, outcome); });
    case Endpoint::kDiagnose:
      return queued([&](CallOutcome& outcome) {
        return ask.calls.diagnose(ask.from, about, batch_in(ask.http), outcome);
      });
    case Endpoint::kCheck:
      return queued([&](CallOutcome& outcome) { return checked(ask, about, outcome); });
    default:
      return told_by([&](CallOutcome& outcome) { return activated(ask, about, outcome); },
                     [](const exchange::ModelInfo& model) { return model_json(model); });
  }
}

}  // namespace

HttpReply api_reply(int code, const ordered_json& json) {
  return {code, "application/json", json_text(json)};
}

HttpReply refused_reply_of(const Error& error, const CallOutcome& outcome) {
  ordered_json told = error_json(error);
  int code = status_of(error.code);
  if (outcome.result != "ok") {
    const auto found = kStatusOfResult.find(outcome.result);
    code = found == kStatusOfResult.end() ? 500 : found->second;
    told["result"] = outcome.result;
  }
  HttpReply reply = api_reply(code, {{"error", told}});
  if (code != 503 && code != 504) return reply;
  const auto seconds = std::chrono::ceil<std::chrono::seconds>(outcome.retry_after).count();
  reply.headers["Retry-After"] = std::to_string(std::max<std::int64_t>(seconds, 1));
  return reply;
}

HttpReply answered(const GatewayAsk& ask) {
  const auto same = [](const ordered_json& json) { return json; };
  switch (ask.route.route->endpoint) {
    case Endpoint::kStatus:
      return read_status(ask);
    case Endpoint::kJobs:
      return told_by(
          [&](CallOutcome& outcome) {
            return ask.calls.jobs(ask.from, {ask.http.option("cell")}, 0, outcome);
          },
          [](const auto& jobs) {
            return ordered_json{{"jobs", jobs_json(jobs)}};
          });
    case Endpoint::kJob:
      return read_job(ask);
    case Endpoint::kFindings:
      return read_findings(ask);
    case Endpoint::kModels:
      return told_by(
          [&](CallOutcome& outcome) {
            return ask.calls.models(ask.from, {ask.route.cell}, outcome);
          },
          [&](const auto& models) {
            return ordered_json{{"cell", ask.route.cell}, {"models", models_json(models)}};
          });
    case Endpoint::kPredict:
      return told_by([&](CallOutcome& outcome) { return predicted(ask, outcome); }, same);
    case Endpoint::kCorrect:
      return told_by([&](CallOutcome& outcome) { return corrected(ask, outcome); }, same);
    case Endpoint::kPrograms:
      return told_by([&](CallOutcome& outcome) { return corrected_programs(ask, outcome); }, same);
    case Endpoint::kProgram:
      return corrected_file(ask);
    default:
      return answered_change(ask);
  }
}

}  // namespace trammel
