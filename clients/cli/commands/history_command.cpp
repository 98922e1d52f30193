#include <CLI/CLI.hpp>
#include <algorithm>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/cell_to_train.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/report/history.h"
#include "server/report/pages_beside.h"
#include "server/store/audit_json.h"

namespace trammel::cli {

namespace {

struct HistoryArguments {
  std::string cell, output, json;
  std::vector<std::string> models;
  std::size_t last = 30;
  ServiceOptions service;
};

std::optional<double> metres(const std::optional<double>& mm) {
  return mm ? std::optional(*mm * from_mm(1)) : std::nullopt;
}

Result<CellHistory> history_of_files(const HistoryArguments& arguments) {
  CellHistory history;
  for (const std::string& path : arguments.models) {
    const CompensatedModel model = TRY(load_model(path));
    if (history.cell.empty()) history.cell = model.cell().name;
    if (model.cell().name != history.cell) {
      return refused("the model is of cell {}, the ones before it are of {}", model.cell().name,
                     history.cell)
          .in(path)
          .of("cell")
          .next("give models of one cell");
    }
    history.versions.push_back(on_record(model, static_cast<int>(history.versions.size()) + 1));
  }
  history.of_files = true;
  return history;
}

/// With its parameters, where the service still has the file.
VersionOnRecord version_of(client::Session& session, const exchange::ModelInfo& info) {
  VersionOnRecord one{info.version,        info.id,
                      info.batch_id,       info.trained_at_unix_s,
                      info.training_poses, metres(info.validation_rms_mm),
                      info.in_force};
  const Result<std::string> text = session.export_model(info.cell, info.version);
  const auto model = text.and_then([&](const std::string& t) { return deserialize(t, info.id); });
  if (model) put_on_record(*model, one);
  return one;
}

Status add_trainings(client::Session& session, CellHistory& history) {
  const auto jobs = TRY(session.jobs(history.cell));
  for (const client::DatedJob& job : jobs) {
    if (job.kind != "train" || !job.finished_unix_s) continue;
    history.trainings.push_back(
        {*job.finished_unix_s, fmt::format("{}", fmt::join(job.batches, "+")), job.status.verdict,
         job.status.why, metres(job.status.before_mm), metres(job.status.after_mm)});
  }
  return {};
}

Status add_events(client::Session& session, std::size_t last, CellHistory& history) {
  const auto texts = TRY(session.audit(history.cell, 0, last));
  for (const client::AuditText& text : texts) {
    const auto trail = TRY(audit_of_json(text.json));
    for (const AuditRow& row : trail.rows)
      history.events.push_back(
          {row.at, row.what, row.subject, row.why, row.who, row.before, row.after});
  }
  return {};
}

Result<CellHistory> history_of_service(const HistoryArguments& arguments) {
  const std::string cell = TRY(cell_id(arguments.cell));
  const auto session = TRY(open_session(arguments.service));
  auto models = TRY(session->models(cell));
  std::sort(models.begin(), models.end(),
            [](const auto& a, const auto& b) { return a.version < b.version; });
  const std::size_t skipped = models.size() - std::min(models.size(), arguments.last);
  CellHistory history{cell};
  for (std::size_t i = skipped; i < models.size(); ++i)
    history.versions.push_back(version_of(*session, models[i]));
  TRY(add_trainings(*session, history));
  TRY(add_events(*session, 10 * arguments.last, history));
  return history;
}

Status history(const HistoryArguments& arguments) {
  if (arguments.models.empty() == arguments.cell.empty())
    return failure(ErrorCode::kUsage,
                   "either --cell, of a service, or --model, once for each version")
        .of("--cell");
  Outputs outputs;
  outputs.add("--output", arguments.output);
  outputs.add("--json", arguments.json);
  std::vector<NamedFile> inputs;
  for (const std::string& path : arguments.models) inputs.push_back({"--model", path});
  TRY(outputs.check(inputs));
  const CellHistory found =
      TRY(arguments.models.empty() ? history_of_service(arguments) : history_of_files(arguments));
  outputs.put("--output", with_pages_beside(history_page(found), arguments.output));
  outputs.put("--json", json_text(history_json(found)));
  TRY(outputs.write());
  tell(fmt::format("cell {}: {} versions, {} parameters moved by more than their uncertainty\n",
                   found.cell, found.versions.size(), moved_parameters(found).size()),
       {arguments.output, arguments.json});
  return {};
}

}  // namespace

void add_history_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<HistoryArguments>();
  CLI::App* command = app.add_subcommand(
      "history",
      "Show what a cell has been through: its parameters over the versions, errors, events");
  command->add_option("--cell", arguments->cell,
                      "The cell, by its name or its file; asks a service");
  command->add_option("--model", arguments->models,
                      "Model file of a version, once for each, the oldest first");
  command->add_option("--last", arguments->last, "How many versions of a service, the newest")
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output, "Page to write (HTML)")->required();
  add_json_option(*command, arguments->json);
  add_options_of_service_command(*command, arguments->service);
  command->callback([arguments, &chosen] { chosen = [arguments] { return history(*arguments); }; });
}

}  // namespace trammel::cli
