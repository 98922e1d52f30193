#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/batch_files.h"
#include "clients/cli/files/cell_to_train.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/evaluation_text.h"
#include "clients/cli/text/notes_text.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/compensate/budget/error_budget.h"
#include "server/compensate/known_rows.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/compensate/world.h"
#include "server/diagnose/triage.h"
#include "server/error_sources/cause_words.h"
#include "server/health/health_check.h"
#include "server/measurement/gauges.h"
#include "server/report/budget_json.h"
#include "server/report/measured_json.h"
#include "server/report/model_page.h"
#include "server/report/note_json.h"
#include "server/report/pages_beside.h"
#include "server/tasks/train/first_batch.h"
#include "server/tasks/train/refitted.h"
#include "server/tasks/train/told_by_training.h"
#include "server/tasks/train/train.h"

namespace trammel::cli {

namespace {

/// Rows that were compared, with a position or without.
int rows_of(const Evaluation& evaluation) {
  return evaluation.poses + (evaluation.gauges ? evaluation.gauges->rows : 0);
}

struct TrainArguments {
  std::string from;
  std::string refit = "base,tool";
  std::string cell, output, json;
  std::vector<std::string> batches;
  std::optional<std::string> level, bias;
  std::vector<std::string> fleet;
  std::uint64_t seed = 1;
  double validation_share = 0;
  bool as_read = false;
};

/// Checks the batch against the model to start from, as the service does before training. Only the
/// refitted sources may differ. Training would learn any other difference as part of them.
Status hold_against(const CompensatedModel& from, const std::vector<std::string>& refit,
                    const Cell& cell, const CheckedBatch& batch) {
  TRY(check_may_start_from(from, cell, batch.rows(), refit));
  const auto& rows = batch.rows().measurements;
  const bool known =
      std::all_of(rows.begin(), rows.end(), [&](const Measurement& m) { return knows(from, m); });
  if (!known) return {};  // its tools are others: nothing to compare
  const Triage seen = triage(from, batch, with_known_tools(cell, from, refit));
  const auto is_refitted = [&](const Cause& cause) {
    const causes::Rival* whole = whole_of(record_of(cause));
    return whole != nullptr && std::find(refit.begin(), refit.end(), whole->cause) != refit.end();
  };
  const bool refitted = seen.verdict == TriageVerdict::kExplained && seen.cause.pose_id.empty() &&
                        is_refitted(seen.cause) &&
                        (!seen.tracker_elsewhere || corrects(refit, causes::Part::kBase));
  if (seen.learn || refitted) return {};
  return refused("{}", seen.sentence)
      .in("batch " + batch.id())
      .of("--refit")
      .next(fmt::format("refitting {} would not learn that: train without --from",
                        causes_in_words(refit)));
}

Result<std::vector<FleetMember>> twins_of(const std::vector<std::string>& paths) {
  std::vector<FleetMember> twins;
  for (const std::string& path : paths) {
    CompensatedModel model = TRY(load_model(path));
    twins.push_back({path, std::move(model)});
  }
  return twins;
}

nlohmann::ordered_json unlike_json(const std::vector<Unlike>& unlike) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const Unlike& one : unlike) {
    json.push_back({{"parameter", one.parameter},
                    {"unit", one.unit},
                    {"value", one.value},
                    {"twins", one.fleet_mean},
                    {"twins_u95", 2 * one.fleet_stddev},
                    {"z", one.z}});
  }
  return json;
}

nlohmann::ordered_json jump_json(const Jump& jump) {
  return {{"source", jump.source},   {"pose_id", jump.pose_id},
          {"row", jump.row},         {"effect_rms_mm", to_mm(jump.effect)},
          {"p_value", jump.p_value}, {"could_also_be", jump.could_also_be}};
}

Status train_model(const TrainArguments& arguments) {
  if (arguments.bias) {
    if (const Status spelled = check_bias_spelling(*arguments.bias); !spelled)
      return Failure(spelled.error())
          .as(ErrorCode::kUsage)
          .of("--bias")
          .next("trammel help levels tells about kernels");
  }
  Cell cell = TRY(read_cell_to_train(
      arguments.cell,
      {.error_sources = !arguments.level && arguments.from.empty(), .bias = !arguments.bias}));
  const CheckedBatch batch = TRY(read_checked_batches(
      arguments.batches, cell, drawn(arguments.validation_share, arguments.seed)));
  TrainOptions options;
  options.level = arguments.level;
  options.bias = arguments.bias;
  options.seed = arguments.seed;
  options.trained_at = unix_now();
  options.looked_at = arguments.as_read;
  const std::vector<FleetMember> twins = TRY(twins_of(arguments.fleet));
  std::optional<FleetPrior> fleet = TRY(prior_of_twins(cell, twins));
  options.fleet = std::move(fleet);
  if (!arguments.from.empty()) {
    CompensatedModel from = TRY(load_model(arguments.from));
    options.from = std::move(from);
    std::vector<std::string> refit = TRY(parse_level(arguments.refit));
    options.refit = std::move(refit);
    TRY(hold_against(*options.from, options.refit, cell, batch));
  }
  const auto shared = std::make_shared<const Cell>(std::move(cell));
  // The batch needs no check if a model to start from has judged it, or if a person has looked at
  // it.
  if (!arguments.as_read && arguments.from.empty())
    TRY(check_first_batch(shared, batch, arguments.level));
  const CompensatedModel model = TRY([&] {
    ProgressLine progress;
    options.progress = [&](const std::string& stage, double share) {
      progress.show(stage, share);
      return true;
    };
    return train(shared, batch, options);
  }());
  TRY(write_output(arguments.output, serialize(model)));
  const auto& parts = model.parts();
  const ToldByTraining told = told_by_training(model, batch, options);
  tell(model_text(model) + notes_text(told.notes()) +
           (parts.validation
                ? fmt::format("on {} poses held out:\n", rows_of(*parts.validation)) +
                      evaluation_table(*parts.validation)
                : fmt::format(
                      "on the {} poses of batch {} it was trained on (none were held out):\n",
                      rows_of(parts.training), parts.provenance.figures_batch_id()) +
                      evaluation_table(parts.training)),
       {arguments.output, arguments.json});
  nlohmann::ordered_json json = model_json(model);
  json["notes"] = notes_json(told.beside(notes_of(model)));
  if (options.fleet) json["unlike_twins"] = unlike_json(told.unlike);
  if (told.jump) json["jump"] = jump_json(*told.jump);
  return write_json(arguments.json, json);
}

struct EvaluateArguments {
  std::string model, json, residuals;
  std::vector<std::string> batches;
  ServiceOptions service;
};

/// The note on how sessions of a batch were placed for a model, for people; empty if none had to be
/// placed.
std::string located_text(const InWorld& world) {
  if (world.located.empty()) return "";
  return fmt::format(
      "note: where the instrument of session {} stood was found from its own poses\n",
      fmt::join(world.located, ", "));
}

std::string learned_text(std::ptrdiff_t poses) {
  if (poses == 0) return "";
  return fmt::format(
      "note: the model was trained on {} of these poses: they say how well it fits, not how well "
      "it predicts\n",
      poses);
}

/// Warns on standard error, where results for programs do not hide it: figures at poses of another
/// robot are meaningless.
void warn_of_foreign_poses(const CompensatedModel& model, const MeasurementBatch& batch) {
  if (const auto foreign = foreign_poses(model, batch))
    std::fputs(shown_lines(fmt::format("warning: {}\n", *foreign)).c_str(), stderr);
}

Status check_outputs(const EvaluateArguments& arguments) {
  if (arguments.residuals.empty()) return {};
  Outputs outputs;
  outputs.add("--residuals", arguments.residuals);
  outputs.add("--json", arguments.json);
  std::vector<NamedFile> inputs = {{"--model", arguments.model}};
  for (const std::string& batch : arguments.batches) inputs.push_back({"--batch", batch});
  return outputs.check(inputs);
}

Status evaluate(const EvaluateArguments& arguments) {
  TRY(check_outputs(arguments));
  const CompensatedModel model = TRY(model_named(arguments.model, arguments.service));
  const CheckedBatch batch = TRY(read_checked_batches(arguments.batches, model.cell()));
  const InWorld world = TRY(in_world_of(model, batch.rows()));
  const Evaluation evaluation = model.evaluate(world.batch);
  const std::vector<Note> notes = notes_of(model);
  warn_of_notes(notes);
  if (has_gauges(world.batch) && !arguments.residuals.empty() && has_positions(world.batch)) {
    return failure(ErrorCode::kUsage,
                   "residuals of positions and of distances or touches go into two files")
        .of("--residuals")
        .next("evaluate the rows of each kind by themselves");
  }
  const MeasurementBatch positions = positions_of(world.batch);
  const CompensatedModel::LevelErrors errors = model.errors_B(positions);
  const auto learned =
      std::count_if(world.batch.measurements.begin(), world.batch.measurements.end(),
                    LearnedFrom(model, batch.hash()));
  const std::string structure =
      positions.measurements.empty() ? "" : structure_note(model, positions, errors);
  tell(fmt::format("model {} on {} poses of {}:\n", model.provenance().id, rows_of(evaluation),
                   batch.id()) +
           evaluation_table(evaluation) + "the model rests on " +
           in_words(model.parts().measured, model.cell()) + "\n" + located_text(world) +
           learned_text(learned) + (structure.empty() ? "" : "note: " + structure + "\n"),
       {arguments.json, arguments.residuals});
  if (!arguments.residuals.empty()) {
    const Status written = write_output(
        arguments.residuals, has_gauges(world.batch)
                                 ? gauge_residuals_csv(world.batch, model.gauge_errors(world.batch))
                                 : residuals_csv(positions, errors));
    if (!written) return written;
  }
  warn_of_foreign_poses(model, world.batch);
  nlohmann::ordered_json json = evaluation_json(evaluation);
  json["measured"] = measured_json(model);
  json["budget"] = positions.measurements.empty() ? nlohmann::ordered_json(nullptr)
                                                  : budget_json(error_budget(model, positions));
  json["notes"] = notes_json(notes);
  if (!structure.empty()) json["structure"] = structure;
  if (learned > 0) json["trained_on"] = learned;
  return write_json(arguments.json, json);
}

struct ReportArguments {
  std::string model, batch, output, json;
  ServiceOptions service;
};

Status report(const ReportArguments& arguments) {
  const CompensatedModel model = TRY(model_named(arguments.model, arguments.service));
  std::optional<MeasurementBatch> batch;
  std::string note;
  if (!arguments.batch.empty()) {
    const CheckedBatch checked = TRY(read_checked_batches({arguments.batch}, model.cell()));
    TRY(require_positions(checked.rows(), "report --batch"));
    InWorld world = TRY(in_world_of(model, checked.rows()));
    const std::size_t learned =
        std::erase_if(world.batch.measurements, LearnedFrom(model, checked.hash()));
    if (!world.batch.measurements.empty()) batch = std::move(world.batch);
    if (learned > 0)
      note = fmt::format(
          "note: {} of the {} poses of {} do not judge the model, because it was trained on them\n",
          learned, checked.size(), arguments.batch);
  }
  warn_of_notes(notes_of(model));
  if (batch) warn_of_foreign_poses(model, *batch);
  if (const Status written = write_output(
          arguments.output, with_pages_beside(model_page(model, batch), arguments.output));
      !written)
    return written;
  tell(note + fmt::format("report of model {} in {}\n", model.provenance().id, arguments.output),
       {arguments.output, arguments.json});
  return write_json(arguments.json, model_json(model));
}

void add_train(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = app.add_subcommand(
      "train", "Calibrate a cell's robot, and learn what calibration leaves over");
  command->add_option("--cell", arguments->cell, "Cell file (YAML)")->required();
  add_batches_option(*command, arguments->batches)->required();
  command->add_option("--level", arguments->level,
                      "What to identify instead of the cell's error sources: M0 (nothing), M1 "
                      "(base), M2 (base, geometry), M3 (base, geometry, compliance), a list of "
                      "sources, a level and more: M2,gear_transmission:3, or auto (what the poses "
                      "ask for)");
  command->add_option("--bias", arguments->bias,
                      "Kernel of the learned bias instead of the cell's: se, matern52 + joint_map, "
                      "..., none, or auto (the simplest that poses left out say is worth it)");
  command->add_option("--from", arguments->from,
                      "Model file of the same robot to start from: all but the sources of --refit "
                      "stay as they are");
  command
      ->add_option("--refit", arguments->refit,
                   "With --from: error sources to identify anew, joined by commas")
      ->needs("--from")
      ->capture_default_str();
  command->add_option(
      "--fleet", arguments->fleet,
      "Model file of a robot of the same type, once for each, at least three: what they have in "
      "common is expected of this one, but for what it is unlike them in");
  add_seed_option(*command, arguments->seed, "Seed of the search and of the rows held out");
  command
      ->add_option("--validation-share", arguments->validation_share,
                   "Share of the poses to hold out, 0 to 0.9, where the batch has no set column; "
                   "0: none are held out")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  command->add_flag("--as-read", arguments->as_read,
                    "Learn from the batch as it is, though another reading of it fits better or "
                    "something changed in the middle of it");
  command->add_option("-o,--output", arguments->output, "Model file to write")->required();
  add_json_option(*command, arguments->json);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return train_model(*arguments); }; });
}

void add_evaluate(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<EvaluateArguments>();
  CLI::App* command = app.add_subcommand(
      "evaluate", "Compare a model with measurements: errors in mm, of orientations in deg");
  add_model_option(*command, arguments->model);
  add_batches_option(*command, arguments->batches)->required();
  command->add_option("--residuals", arguments->residuals,
                      "Also write what is left of each pose, axis by axis, to this file (CSV; '-': "
                      "standard output)");
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return evaluate(*arguments); }; });
}

void add_report(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<ReportArguments>();
  CLI::App* command =
      app.add_subcommand("report", "Write a model's report as a page that opens offline");
  add_model_option(*command, arguments->model);
  command->add_option(
      "--batch", arguments->batch,
      "Measurements to compare it with (CSV: joints in deg, rails in mm; positions in mm)");
  command->add_option("-o,--output", arguments->output, "Page to write (HTML)")->required();
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback([arguments, &chosen] { chosen = [arguments] { return report(*arguments); }; });
}

}  // namespace

void add_model_commands(CLI::App& app, Action& chosen) {
  add_train(app, chosen);
  add_evaluate(app, chosen);
  add_report(app, chosen);
}

}  // namespace trammel::cli
