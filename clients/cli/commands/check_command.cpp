#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <optional>

#include "clients/cli/commands/commands.h"
#include "clients/cli/service/health_answers.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/notes_text.h"
#include "server/base/json_guard.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/measurement/files/batch_file.h"
#include "server/report/cell_health.h"
#include "server/report/health_json.h"
#include "server/report/health_page.h"
#include "server/report/pages_beside.h"
#include "server/tasks/check/check.h"

namespace trammel::cli {

namespace {

struct CheckArguments {
  std::string model, batch, json, report;
  std::vector<std::string> earlier;
  std::optional<double> tolerance_mm;
  bool new_tool = false, strict = false;
  ServiceOptions service;
};

Result<std::int64_t> ask(client::Session& session, const std::string& cell,
                         const CheckArguments& arguments) {
  const double tolerance =
      arguments.tolerance_mm.value_or(std::numeric_limits<double>::quiet_NaN());
  if (!std::filesystem::exists(arguments.batch))
    return session.check_health(cell, arguments.batch, "", tolerance);
  return read_text_file(arguments.batch).and_then([&](const std::string& csv) {
    return session.check_health(cell, "", csv, tolerance);
  });
}

/// A check that a service made; its bytes come from outside.
Result<nlohmann::ordered_json> check_of(const std::string& text, const std::string& what) {
  TRY(check_json_limits(text, what));
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(text, nullptr, false);
  const bool whole = json.is_object() && json.contains("verdict") && json["verdict"].is_string() &&
                     json.contains("why") && json["why"].is_string();
  if (!whole) return failure(ErrorCode::kInternal, "{} is no check", what);
  return json;
}

Result<nlohmann::ordered_json> found_by(client::Session& session, const std::string& cell,
                                        std::int64_t job) {
  const auto found = TRY(session.diagnosis(cell, job, false));
  return check_of(found.findings_json, fmt::format("what job {} found", job));
}

/// The name of the measurements: a file without its folder and ending, or the id under which the
/// service stores them.
std::string batch_name(const std::string& batch) {
  return std::filesystem::path(batch).stem().string();
}

/// `next check: 2026-03-01; ...`; empty if there is no date.
std::string due_text(const nlohmann::ordered_json& check) {
  const auto text_of = [&](const char* key) {
    return check.contains(key) && check[key].is_string() ? check[key].get<std::string>()
                                                         : std::string();
  };
  const std::string due = text_of("due"), because = text_of("due_because");
  if (due.empty() && because.empty()) return "";
  return fmt::format("next check: {}{}{}\n", due, due.empty() ? "" : "; ", because);
}

/// The actions for the changes, each once. `why` contains their effect in millimetres. Empty if
/// nothing changed, or if the server does not send it.
std::string actions_text(const nlohmann::ordered_json& check) {
  const auto budget = check.find("budget");
  if (budget == check.end() || !budget->is_object() || !budget->contains("lines") ||
      !(*budget)["lines"].is_array())
    return "";
  std::vector<std::string> actions;
  for (const auto& line : (*budget)["lines"]) {
    if (!line.is_object() || !line.contains("action") || !line["action"].is_string()) continue;
    const auto action = line["action"].get<std::string>();
    if (!action.empty() && std::find(actions.begin(), actions.end(), action) == actions.end())
      actions.push_back(action);
  }
  return actions.empty() ? "" : fmt::format("what to do: {}\n", fmt::join(actions, "; "));
}

std::string check_text(const nlohmann::ordered_json& check) {
  return fmt::format("{}: {}\n", check.at("verdict").get<std::string>(),
                     check.at("why").get<std::string>()) +
         actions_text(check) + due_text(check);
}

/// Prints the notes of the model that a service checked against, as warn_of_notes() does.
void warn_of_notes_in(const nlohmann::ordered_json& check) {
  if (!check.contains("notes") || !check["notes"].is_array()) return;
  for (const auto& note : check["notes"]) {
    const bool whole = note.is_object() && note.contains("severity") &&
                       note["severity"].is_string() && note.contains("text") &&
                       note["text"].is_string();
    if (!whole) continue;
    const auto severity = note["severity"].get<std::string>();
    if (severity == to_text(Note::Severity::kInfo)) continue;
    std::fputs(
        shown_lines(fmt::format("{}: {}\n", severity, note["text"].get<std::string>())).c_str(),
        stderr);
  }
}

/// kPart if --strict requires a healthy robot and this one is not shown to be healthy.
Extent extent_of(const nlohmann::ordered_json& check, const CheckArguments& arguments) {
  if (!arguments.strict || check.at("verdict") == std::string(to_string(HealthVerdict::kHealthy)))
    return Extent::kAll;
  std::fputs(shown_lines("not shown to be healthy: " + check_text(check)).c_str(), stderr);
  return Extent::kPart;
}

Status check_outputs(const CheckArguments& arguments) {
  Outputs outputs;
  outputs.add("--report", arguments.report);
  outputs.add("--json", arguments.json);
  return outputs.check({{"--model", arguments.model}, {"--batch", arguments.batch}});
}

Status write_report(const nlohmann::ordered_json& found, const HealthPageOf& of,
                    const CheckArguments& arguments) {
  if (arguments.report.empty()) return {};
  return write_output(arguments.report,
                      with_pages_beside(health_page(found.dump(), of), arguments.report));
}

/// Prints the findings of earlier checks.
Status tell_health(client::Session& session, const std::string& cell,
                   const CheckArguments& arguments) {
  const auto cells = TRY(health_at(session, cell, 0));
  std::string text;
  for (const auto& one : cells) text += cell_health_text(one);
  tell(text, {arguments.json});
  return write_json(arguments.json, {{"cells", cells}});
}

Result<Extent> check_at_service(const CheckArguments& arguments) {
  if (arguments.new_tool)
    return failure(ErrorCode::kUsage, "--new-tool is for files").of("--new-tool");
  if (!arguments.earlier.empty())
    return failure(ErrorCode::kUsage, "--earlier is for files").of("--earlier");
  const ModelReference model = TRY(parse_model_reference(arguments.model));
  if (model.version != 0) {
    return failure(ErrorCode::kUsage, "a service checks against the model in force")
        .of("--model")
        .next(fmt::format("name the cell alone: trammel check {} BATCH --service", model.cell));
  }
  const auto session = TRY(open_session(arguments.service));
  if (arguments.batch.empty()) {
    TRY(tell_health(*session, model.cell, arguments));
    return Extent::kAll;
  }
  const std::int64_t job = TRY(ask(*session, model.cell, arguments));
  const client::JobStatus end = TRY([&] {
    ProgressLine progress;
    return session->wait_for_job(job, std::chrono::hours(1), [&](const client::JobStatus& status) {
      progress.show(fmt::format("job {} {}: {}", status.job, status.stage, status.what),
                    status.share);
    });
  }());
  if (end.stage == "failed")
    return refused("job {} of cell {} failed: {}", end.job, end.cell, end.what).of("job");
  const auto json = TRY(found_by(*session, model.cell, job));
  warn_of_notes_in(json);
  tell(check_text(json), {arguments.json, arguments.report});
  TRY(write_report(json, {model.cell, batch_name(arguments.batch), unix_now()}, arguments));
  TRY(write_json(arguments.json, json));
  return extent_of(json, arguments);
}

/// The drift by earlier checks, read from files that `--json` wrote.
Result<std::vector<DriftSeen>> earlier_drift(const std::vector<std::string>& files) {
  std::vector<DriftSeen> all;
  for (const std::string& file : files) {
    const std::string text = TRY(read_text_file(file));
    if (const auto json = check_of(text, file); !json)
      return Failure(json.error()).as(ErrorCode::kRefused).in(file);
    if (auto drift = drift_of(text)) all.push_back(std::move(*drift));
  }
  return all;
}

Result<Extent> check(const CheckArguments& arguments) {
  if (arguments.batch.empty()) {
    return failure(ErrorCode::kUsage, "a check needs measurements")
        .of("--batch")
        .next("trammel plan --check N plans the poses");
  }
  const CompensatedModel model = TRY(load_model(arguments.model));
  const CheckedBatch batch = TRY(read_batch(arguments.batch).and_then([&](MeasurementBatch read) {
    return check_against_cell(std::move(read), model.cell());
  }));
  CheckAsked asked;
  if (arguments.tolerance_mm) asked.tolerance = *arguments.tolerance_mm * from_mm(1);
  asked.new_tool = arguments.new_tool;
  asked.earlier = TRY(earlier_drift(arguments.earlier));
  const HealthCheck health = TRY(check_robot(model, model.cell(), batch, std::move(asked)));
  const auto json = check_json(health, batch, model);
  warn_of_notes(notes_of(model));
  tell(health_text(health) + actions_text(json), {arguments.json, arguments.report});
  TRY(write_report(json, {model.cell().name, batch.id(), unix_now(), &model.cell()}, arguments));
  TRY(write_json(arguments.json, json));
  return extent_of(json, arguments);
}

}  // namespace

void add_check_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<CheckArguments>();
  CLI::App* command = app.add_subcommand(
      "check", "Say by a few poses whether the robot still is as its model has it");
  command
      ->add_option("--model", arguments->model,
                   "Model file; with --service a cell's id: its model in force")
      ->required();
  command->add_option(
      "--batch", arguments->batch,
      "A few measurements (CSV: joints in deg, rails in mm; positions in mm), as plan --check "
      "plans them; with --service also the id of a batch that the service has, or left out: what "
      "checks have said so far, and when the next one is due");
  command->add_option("--earlier", arguments->earlier,
                      "What an earlier check of this robot wrote with --json, once for each: the "
                      "next one is due by all of them; a service has its own");
  command
      ->add_option("--tolerance", arguments->tolerance_mm,
                   "What the cell must hold, mm, instead of the cell file's tolerance_mm (0.1 "
                   "where it says none)")
      ->check(above_zero());
  command->add_flag("--new-tool", arguments->new_tool,
                    "The tool was changed or mounted anew: where it sits is found with the base, "
                    "and is no change");
  command->add_flag("--strict", arguments->strict,
                    "Exit with 1, not 0, where the robot is not shown to be healthy");
  command
      ->add_option("--report", arguments->report, "Page to write (HTML); opens without a network")
      ->type_name("FILE");
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback([arguments, &chosen] {
    chosen = [arguments]() -> Result<Extent> {
      TRY(check_outputs(*arguments));
      return arguments->service.service ? check_at_service(*arguments) : check(*arguments);
    };
  });
}

}  // namespace trammel::cli
