#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>
#include <type_traits>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/near_columns.h"
#include "clients/cli/service/health_answers.h"
#include "clients/cli/service/named_places.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/evaluation_text.h"
#include "clients/cli/text/notes_text.h"
#include "clients/cli/text/service_text.h"
#include "server/base/text_file.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/measurement/files/batch_file.h"
#include "server/report/cell_health.h"
#include "server/report/note_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

/// The options of all these commands; each uses its own part.
struct ServiceArguments {
  std::string cell, batch, batch_id, level, bias, model, output, json, reason;
  std::vector<std::string> batch_ids;
  std::optional<int> expected;
  std::int64_t job = 0;
  bool watch = false, release = false, force = false;
  double limit_s = 3600;
  TableForm form = TableForm::kTable;
  ServiceOptions service;
};

/// A job is complete if it made no model, or if it put its model in force.
Extent extent_of(const client::JobStatus& job) {
  return job.model_version == 0 || put_in_force(job) ? Extent::kAll : Extent::kPart;
}

/// Notes for users of a version; 0: of the version in force. Empty if the service sends none.
Result<std::vector<Note>> notes_of_version(client::Session& session, const std::string& cell,
                                           int version) {
  const std::vector<exchange::ModelInfo> models = TRY(session.models(cell));
  const auto asked =
      std::find_if(models.begin(), models.end(), [&](const exchange::ModelInfo& model) {
        return version == 0 ? model.in_force : model.version == version;
      });
  return asked == models.end() ? std::vector<Note>() : asked->notes;
}

/// Notes for users of the model that the job put in force.
Result<std::vector<Note>> notes_of_made(client::Session& session, const client::JobStatus& job) {
  if (!put_in_force(job)) return std::vector<Note>();
  return notes_of_version(session, job.cell, job.model_version);
}

/// Follows a job to its end; a failed one is an error.
Result<Extent> follow(client::Session& session, std::int64_t job,
                      const ServiceArguments& arguments) {
  const client::JobStatus end = TRY([&] {
    ProgressLine progress;
    return session.wait_for_job(
        job, std::chrono::milliseconds(static_cast<std::int64_t>(arguments.limit_s * 1e3)),
        [&](const client::JobStatus& status) {
          progress.show(fmt::format("job {} {}: {}", status.job, status.stage, status.what),
                        status.share);
        });
  }());
  const std::vector<Note> notes = TRY(notes_of_made(session, end));
  ordered_json json = job_json(end);
  json["notes"] = notes_json(notes);
  TRY(write_json(arguments.json, json));
  const std::string next = next_step(end);
  if (end.stage == "failed" || end.stage == "cancelled") {
    return refused("job {} of cell {} {}: {}", end.job, end.cell, end.stage, end.what)
        .of("job")
        .with_value(end.job)
        .next(next);
  }
  warn_of_notes(notes);
  tell(ended_text(end) + (next.empty() ? "" : next + "\n"), {arguments.json});
  return extent_of(end);
}

/// Tells the job's number, or with --watch follows it.
Result<Extent> started(client::Session& session, const std::string& cell, std::int64_t job,
                       const ServiceArguments& arguments) {
  if (arguments.watch) return follow(session, job, arguments);
  tell(started_text(cell, job), {arguments.json});
  return write_json(arguments.json, {{"job", job}}).map([] { return Extent::kAll; });
}

Result<Extent> submit(client::Session& session, const ServiceArguments& arguments) {
  const std::string cell = TRY(cell_id(arguments.cell));
  const std::string csv = TRY(read_text_file(arguments.batch));
  if (const auto batch = parse_batch(csv, arguments.batch))
    tell_columns_left_aside(*batch, csv, arguments.batch);
  const std::string id = arguments.batch_id.empty()
                             ? std::filesystem::path(arguments.batch).stem().string()
                             : arguments.batch_id;
  const std::int64_t job = TRY(session.submit_measurements(cell, id, csv));
  return started(session, cell, job, arguments);
}

Result<Extent> retrain(client::Session& session, const ServiceArguments& arguments) {
  const std::string cell = TRY(cell_id(arguments.cell));
  if (arguments.release && arguments.batch_ids.empty()) {
    return failure(ErrorCode::kUsage, "--release needs --batch")
        .of("--batch")
        .next("say which one is good");
  }
  const std::int64_t job = TRY(
      arguments.release
          ? session.release_and_train(cell, arguments.batch_ids, arguments.level, arguments.bias)
          : session.train(cell, arguments.batch_ids, arguments.level, arguments.bias));
  return started(session, cell, job, arguments);
}

bool is_checked(const ordered_json& cell) {
  return cell.contains("verdict") && cell["verdict"].is_string();
}

/// The additional role of an answering server, as far as it states it.
ordered_json part_of(const std::string& server, const std::vector<ordered_json>& answers) {
  ordered_json part = {{"serves", true}, {"trains", nullptr}, {"reachable", true}};
  for (const ordered_json& answer : answers)
    if (answer.value("server", ordered_json()) == server)
      part["trains"] = answer.value("trains", ordered_json());
  return part;
}

/// The record of the servers, from the first of them that has it.
ordered_json record_of(const std::vector<ordered_json>& answers) {
  return answers.empty() ? ordered_json() : answers.front().value("record", ordered_json());
}

/// The servers of the record, from the first answer that lists them. Null if no answer does.
ordered_json fleet_of(const std::vector<ordered_json>& answers) {
  for (const ordered_json& answer : answers)
    if (answer.contains("servers") && answer["servers"].is_array()) return answer["servers"];
  return nullptr;
}

Status status(client::Session& session, const ServiceArguments& arguments) {
  const std::vector<client::ServerStatus> servers = TRY(session.servers());
  const std::vector<exchange::ModelInfo> models = TRY(session.model_status());
  const std::vector<ordered_json> answers = TRY(health_answers(session, "", 1));
  const std::vector<ordered_json> health = cells_of(answers);
  const ordered_json record = record_of(answers);
  const bool is_away = record.contains("reachable") && record["reachable"] == false;
  std::vector<client::BatchOfService> apart;  // both come from the record
  std::vector<client::DatedJob> jobs;
  if (!is_away) {
    apart = TRY(session.quarantine(""));
    jobs = TRY(session.jobs(""));
  }
  std::string text, checked;
  for (const ordered_json& cell : health) checked += is_checked(cell) ? cell_health_line(cell) : "";
  ordered_json list = ordered_json::array();
  for (const client::ServerStatus& server : servers) {
    text += server_text(server);
    list.push_back(server_json(server));
    list.back().update(part_of(server.server_id, answers));
  }
  const ordered_json fleet = fleet_of(answers);
  add_other_servers(fleet, list);
  const std::vector<std::string> silent = silent_servers(arguments.service, servers.size());
  for (const std::string& line : silent) text += line + "\n";
  text += record_text(record) + servers_text(fleet, record);
  text += models_text(models, arguments.form) + checked;
  if (!is_away) text += jobs_text(jobs) + quarantine_text(apart);
  tell(text, {arguments.json});
  return write_json(arguments.json,
                    {{"record", record},
                     {"servers", list},
                     {"silent", silent},
                     {"fleet", fleet},
                     {"models", models_json(models)},
                     {"health", health},
                     {"jobs", is_away ? ordered_json() : jobs_json(jobs)},
                     {"quarantine", is_away ? ordered_json() : quarantine_json(apart)}});
}

Result<Extent> watch(client::Session& session, const ServiceArguments& arguments) {
  return follow(session, arguments.job, arguments);
}

Status list_models(client::Session& session, const ServiceArguments& arguments) {
  const std::string cell = TRY(cell_id(arguments.cell));
  const std::vector<exchange::ModelInfo> models = TRY(session.models(cell));
  tell(models_text(models, arguments.form), {arguments.json});
  return write_json(arguments.json, {{"cell", cell}, {"models", models_json(models)}});
}

Status list_jobs(client::Session& session, const ServiceArguments& arguments) {
  const std::string cell =
      TRY(arguments.cell.empty() ? Result<std::string>() : cell_id(arguments.cell));
  const std::vector<client::DatedJob> jobs = TRY(session.jobs(cell));
  tell(all_jobs_text(jobs, arguments.form), {arguments.json});
  return write_json(arguments.json, {{"jobs", jobs_json(jobs)}});
}

Status list_batches(client::Session& session, ServiceArguments arguments) {
  if (arguments.batch_id.empty() && take_form(arguments.output, arguments.form, arguments.json))
    arguments.output.clear();
  const std::string cell =
      TRY(arguments.cell.empty() ? Result<std::string>() : cell_id(arguments.cell));
  if (arguments.batch_id.empty() != arguments.output.empty())
    return failure(ErrorCode::kUsage,
                   "--batch and --output go together: the batch is written there")
        .of("--batch");
  if (!arguments.batch_id.empty()) {
    const std::string csv = TRY(session.export_batch(cell, arguments.batch_id));
    return write_output(arguments.output, csv);
  }
  const std::vector<client::BatchOfService> batches = TRY(session.batches(cell));
  tell(batches_text(batches, arguments.form), {arguments.json});
  return write_json(arguments.json, {{"batches", batches_json(batches)}});
}

/// The version that the service's record has in force; 0: none. Empty: not among the versions that
/// a list has.
Result<std::optional<int>> version_in_force(client::Session& session, const std::string& cell) {
  const std::vector<exchange::ModelInfo> models = TRY(session.models(cell));
  if (models.empty()) return std::optional(0);
  const auto in_force =
      std::find_if(models.begin(), models.end(), [](const auto& model) { return model.in_force; });
  if (in_force != models.end()) return std::optional(in_force->version);
  return models.front().version == 1 ? std::optional(0) : std::nullopt;
}

/// The options of a change. It is refused if the version in force is not the version that the user
/// saw. Without a stated version, the present one counts.
Result<client::ChangeOptions> decided_against(client::Session& session, const std::string& cell,
                                              const ServiceArguments& arguments) {
  client::ChangeOptions change;
  change.reason = arguments.reason;
  change.expected_version = arguments.expected;
  if (change.expected_version) return change;
  const auto now = TRY(version_in_force(session, cell));
  change.expected_version = now;
  return change;
}

using BatchChange = Status (client::Session::*)(const std::string&, const std::string&,
                                                const client::ChangeOptions&);

/// `now`: the state of the batch afterwards.
Status change_batch(client::Session& session, const ServiceArguments& arguments, BatchChange change,
                    const char* now) {
  const std::string cell = TRY(cell_id(arguments.cell));
  const client::ChangeOptions options = TRY(decided_against(session, cell, arguments));
  const std::string& batch = arguments.batch_id;
  TRY((session.*change)(cell, batch, options));
  tell(fmt::format("cell {}: batch {} is {}\n", cell, batch, now), {arguments.json});
  return write_json(arguments.json, {{"cell", cell}, {"batch", batch}, {"is", now}});
}

Status release(client::Session& session, const ServiceArguments& arguments) {
  return change_batch(session, arguments, &client::Session::release, "released");
}

Status discard(client::Session& session, const ServiceArguments& arguments) {
  return change_batch(session, arguments, &client::Session::discard, "discarded");
}

Status cancel(client::Session& session, const ServiceArguments& arguments) {
  TRY(session.cancel(arguments.job));
  tell(fmt::format("job {} is cancelled; if it ran, it stops as soon as it can\n", arguments.job),
       {arguments.json});
  return write_json(arguments.json, {{"job", arguments.job}, {"is", "cancelled"}});
}

/// The cell's model in force by the service, with its figures against the former one; null if the
/// service sends none.
ordered_json in_force_at(client::Session& session, const std::string& cell) {
  const auto cells = health_at(session, cell, 1);
  if (!cells) return nullptr;
  for (const ordered_json& one : *cells)
    if (one.contains("in_force") && one["in_force"].is_object()) return one["in_force"];
  return nullptr;
}

Status now_in_force(client::Session& session, const std::string& cell, int version,
                    const ServiceArguments& arguments) {
  ordered_json now = in_force_json(cell, version, in_force_at(session, cell));
  // The change is made; a failed request afterwards does not undo it.
  const std::vector<Note> notes =
      notes_of_version(session, cell, version).value_or(std::vector<Note>());
  now["notes"] = notes_json(notes);
  warn_of_notes(notes);
  tell(in_force_text(now), {arguments.json});
  return write_json(arguments.json, now);
}

Status activate(client::Session& session, const ServiceArguments& arguments) {
  const ModelReference model = TRY(parse_model_reference(arguments.model));
  if (model.version == 0) {
    return failure(ErrorCode::kUsage, "--model '{}': expected cell@version", arguments.model)
        .of("--model")
        .with_text(arguments.model)
        .next(fmt::format("trammel models {} lists its versions", model.cell));
  }
  client::ChangeOptions options = TRY(decided_against(session, model.cell, arguments));
  options.force = arguments.force;
  const int version = TRY(session.activate(model.cell, model.version, options));
  return now_in_force(session, model.cell, version, arguments);
}

Status rollback(client::Session& session, const ServiceArguments& arguments) {
  const std::string cell = TRY(cell_id(arguments.cell));
  const client::ChangeOptions options = TRY(decided_against(session, cell, arguments));
  const int version = TRY(session.rollback(cell, options));
  return now_in_force(session, cell, version, arguments);
}

/// Shows a stored version as train shows a new one.
Status show_model(client::Session& session, const ServiceArguments& arguments) {
  const ModelReference asked = TRY(parse_model_reference(arguments.model));
  const auto text = TRY(session.export_model(asked.cell, asked.version));
  const CompensatedModel model =
      TRY(deserialize(text, "the service's model of cell " + asked.cell));
  const auto& judged = model.parts().validation;
  tell(model_text(model) + (judged ? evaluation_table(*judged) : ""), {arguments.json});
  return write_json(arguments.json, model_json(model));
}

/// Notes for users of a model that a service hands out or has taken; nothing for a model that
/// only the service reads.
std::vector<Note> notes_of_file(const std::string& text) {
  const auto model = deserialize(text, "the model");
  return model ? notes_of(*model) : std::vector<Note>();
}

Status export_model(client::Session& session, const ServiceArguments& arguments) {
  const ModelReference model = TRY(parse_model_reference(arguments.model));
  const std::string text = TRY(session.export_model(model.cell, model.version));
  TRY(write_output(arguments.output, text));
  const std::vector<Note> notes = notes_of_file(text);
  warn_of_notes(notes);
  tell(fmt::format("model of cell {} in {}\n", model.cell, arguments.output),
       {arguments.output, arguments.json});
  return write_json(arguments.json, {{"cell", model.cell},
                                     {"file", arguments.output},
                                     {"bytes", text.size()},
                                     {"notes", notes_json(notes)}});
}

Status import_model(client::Session& session, const ServiceArguments& arguments) {
  const std::string cell = TRY(cell_id(arguments.cell));
  const std::string text = TRY(read_text_file(arguments.model));
  const int version = TRY(session.import_model(cell, text));
  const std::vector<Note> notes = notes_of_file(text);
  warn_of_notes(notes);
  tell(fmt::format("cell {}: the model is version {}\n", cell, version), {arguments.json});
  return write_json(arguments.json,
                    {{"cell", cell}, {"version", version}, {"notes", notes_json(notes)}});
}

/// Adds commands that talk to a service.
class ServiceCommands {
 public:
  ServiceCommands(CLI::App& app, Action& chosen) : app_(app), chosen_(chosen) {}

  /// A command whose action opens a session and calls `talk` with the session and the arguments;
  /// `talk` returns like an Action. `add_options` adds its options.
  template <typename Talk, typename AddOptions>
  void add(const char* name, const char* description, Talk talk, AddOptions add_options) {
    const auto arguments = std::make_shared<ServiceArguments>();
    CLI::App* command = app_.add_subcommand(name, description);
    add_options(*command, *arguments);
    add_json_option(*command, arguments->json);
    add_options_of_service_command(*command, arguments->service);
    command->callback([arguments, talk, &chosen = chosen_] {
      chosen = [arguments,
                talk]() -> std::invoke_result_t<Talk, client::Session&, const ServiceArguments&> {
        const auto session = TRY(open_session(arguments->service));
        return talk(*session, *arguments);
      };
    });
  }

 private:
  CLI::App& app_;
  Action& chosen_;
};

void add_cell(CLI::App& command, ServiceArguments& arguments) {
  command.add_option("--cell", arguments.cell, "Cell id, or a cell file (.yaml) that names it")
      ->required();
}

void add_any_cell(CLI::App& command, ServiceArguments& arguments) {
  command.add_option("--cell", arguments.cell,
                     "Cell id, or a cell file (.yaml) that names it; left out: all cells");
}

/// Adds the options with which a person explains a decision.
void add_decision(CLI::App& command, ServiceArguments& arguments) {
  command.add_option("--reason", arguments.reason, "Why, for the audit trail");
  command
      .add_option("--expected", arguments.expected,
                  "Version that was in force when you decided (0: none); with another one nothing "
                  "changes. Left out: the one in force now")
      ->check(CLI::NonNegativeNumber);
}

void add_watch(CLI::App& command, ServiceArguments& arguments) {
  command.add_flag("--watch", arguments.watch,
                   "Wait until the training is done, and say how it ended");
  command.add_option("--limit", arguments.limit_s, "Longest wait for the training, s")
      ->check(above_zero())
      ->capture_default_str();
}

/// Adds the commands for running jobs.
void add_running_jobs(ServiceCommands& commands) {
  commands.add("watch", "Follow a training or a diagnosis until it is done, and say how it ended",
               watch, [](CLI::App& command, ServiceArguments& arguments) {
                 command
                     .add_option("--job", arguments.job,
                                 "Number of the job, as submit, retrain and status tell it")
                     ->required();
                 command.add_option("--limit", arguments.limit_s, "Longest wait, s")
                     ->check(above_zero())
                     ->capture_default_str();
               });
  commands.add(
      "cancel",
      "Stop a training, a diagnosis or a check that waits or runs; the model in force stays",
      cancel, [](CLI::App& command, ServiceArguments& arguments) {
        command.add_option("--job", arguments.job, "Number of the job, as jobs and status tell it")
            ->required();
      });
}

/// Adds the commands for the version in force, for quarantine, and for model files.
void add_model_changes(ServiceCommands& commands) {
  commands.add("activate", "Put a stored version of a cell's model in force", activate,
               [](CLI::App& command, ServiceArguments& arguments) {
                 command
                     .add_option("--model", arguments.model,
                                 "CELL@VERSION, as the command models lists them")
                     ->required();
                 command.add_flag(
                     "--force", arguments.force,
                     "Even if it is worse than the version in force on the poses held out");
                 add_decision(command, arguments);
               });
  commands.add("rollback", "Put back in force the model that was before", rollback,
               [](CLI::App& command, ServiceArguments& arguments) {
                 add_cell(command, arguments);
                 add_decision(command, arguments);
               });
  const auto add_batch = [](CLI::App& command, ServiceArguments& arguments) {
    add_cell(command, arguments);
    command.add_option("--batch", arguments.batch_id, "Id of the batch, as status lists it")
        ->required();
    add_decision(command, arguments);
  };
  commands.add("release", "Let later trainings take a batch that is in quarantine", release,
               add_batch);
  commands.add("discard", "Let nothing take a batch any more", discard, add_batch);
  commands.add(
      "export", "Fetch a model as a file", export_model,
      [](CLI::App& command, ServiceArguments& arguments) {
        command
            .add_option("--model", arguments.model, "Cell id (its model in force) or CELL@VERSION")
            ->required();
        command.add_option("-o,--output", arguments.output, "Model file to write")->required();
      });
  commands.add("import", "Add a model file to a cell's history; activate puts it in force",
               import_model, [](CLI::App& command, ServiceArguments& arguments) {
                 add_cell(command, arguments);
                 command.add_option("--model", arguments.model, "Model file to add")->required();
               });
}

void add_retrain(ServiceCommands& commands) {
  commands.add("retrain", "Train again from batches that the service has", retrain,
               [](CLI::App& command, ServiceArguments& arguments) {
                 add_cell(command, arguments);
                 command
                     .add_option("--batch", arguments.batch_ids,
                                 "Id of a batch that the service has; once for each to train from "
                                 "together; left out: the newest")
                     ->allow_extra_args(false);
                 command.add_option(
                     "--level", arguments.level,
                     "What to identify instead of the cell's error sources, as train spells it");
                 command.add_option(
                     "--bias", arguments.bias,
                     "Kernel of the learned bias instead of the cell's, as train spells it");
                 command.add_flag("--release", arguments.release,
                                  "The batches that --batch names are good: train from them though "
                                  "they are in quarantine. They leave it when the new model is put "
                                  "in force, or when too few poses can judge it");
                 add_watch(command, arguments);
               });
}

}  // namespace

void add_service_commands(CLI::App& app, Action& chosen) {
  ServiceCommands commands(app, chosen);
  commands.add("submit",
               "Hand measurements to a service, which trains a model from them and puts it in "
               "force if it is better",
               submit, [](CLI::App& command, ServiceArguments& arguments) {
                 add_cell(command, arguments);
                 command
                     .add_option("--batch", arguments.batch,
                                 "Measurements (CSV: joints in deg, rails in mm; positions in mm)")
                     ->required();
                 command.add_option("--id", arguments.batch_id,
                                    "Id of the batch, unique within the cell for ever; left out: "
                                    "the file's name without its ending");
                 add_watch(command, arguments);
               });
  add_retrain(commands);
  commands.add("status",
               "Show the servers that answer, the models in force, jobs, and batches in quarantine",
               status, [](CLI::App& command, ServiceArguments& arguments) {
                 add_form_option(command, arguments.form, arguments.json);
               });
  add_running_jobs(commands);
  commands.add("models", "List the history of a cell's models", list_models,
               [](CLI::App& command, ServiceArguments& arguments) {
                 add_cell(command, arguments);
                 add_form_option(command, arguments.form, arguments.json);
               });
  commands.add(
      "show", "Tell what a stored version of a cell's model is, and how large its errors were",
      show_model, [](CLI::App& command, ServiceArguments& arguments) {
        command
            .add_option("--model", arguments.model, "Cell id (its model in force) or CELL@VERSION")
            ->required();
      });
  commands.add("jobs", "List jobs that wait, run, and ended lately, and how", list_jobs,
               [](CLI::App& command, ServiceArguments& arguments) {
                 add_any_cell(command, arguments);
                 add_form_option(command, arguments.form, arguments.json);
               });
  commands.add("batches", "List the batches that a service has, or fetch one as a file",
               list_batches, [](CLI::App& command, ServiceArguments& arguments) {
                 add_any_cell(command, arguments);
                 command.add_option("--batch", arguments.batch_id, "Id of the batch to fetch");
                 command.add_option(
                     "-o,--output", arguments.output,
                     "File to write it to (CSV, as it came: joints in deg, rails in mm; positions "
                     "in mm); of "
                     "the list wide (all columns) or json (for programs, on standard output)");
               });
  add_model_changes(commands);
}

}  // namespace trammel::cli
