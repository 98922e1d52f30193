#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/batch_files.h"
#include "clients/cli/files/cell_to_train.h"
#include "clients/cli/service/diagnose_service.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/diagnose_text.h"
#include "clients/cli/text/notes_text.h"
#include "clients/cli/work/in_parallel.h"
#include "server/base/plain_text.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/diagnose/diagnose.h"
#include "server/report/after_repair_report.h"
#include "server/report/diagnosis_json.h"
#include "server/report/diagnosis_page.h"
#include "server/report/note_json.h"
#include "server/report/pages_beside.h"
#include "server/robot/cell_sources_file.h"
#include "server/tasks/train/did_it_help.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

constexpr const char* kCellOption = "--cell-out";
constexpr const char* kSinceOnFiles =
    "write the service's model with trammel export --model CELL@VERSION, then diagnose without "
    "--service";
constexpr const char* kProveOnFiles =
    "give the cell file and the batch's file, and diagnose without --service";

/// Runs the proof for `minutes` from now on all processors. The progress is the share of that time.
ProveOptions proving(double minutes, ProgressLine& progress) {
  using Clock = std::chrono::steady_clock;
  const auto began = Clock::now();
  const auto used = [began, minutes] {
    return std::chrono::duration<double, std::ratio<60>>(Clock::now() - began).count() / minutes;
  };
  const auto show = [&progress, used](double) {
    progress.show("putting effects into the residuals", std::min(1.0, used()));
  };
  return {.has_time = [used](int) { return used() < 1; },
          .for_each =
              [show](std::size_t count, const std::function<void(std::size_t)>& work) {
                in_parallel(count, work, show, 1);
              }};
}

Result<Diagnosis> run_diagnosis(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                                const DiagnoseArguments& arguments) {
  ProgressLine progress;
  DiagnoseOptions options;
  options.seed = arguments.seed;
  if (arguments.prove) options.prove = proving(arguments.prove_minutes, progress);
  options.progress = [&](const std::string& stage, double share) {
    progress.show(stage, share);
    return true;
  };
  return diagnose(cell, batch, options);
}

Result<Applied> run_extension(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                              const Diagnosis& diagnosis, std::uint64_t seed) {
  ProgressLine progress;
  TrainOptions options;
  options.seed = seed;
  options.trained_at = unix_now();
  options.progress = [&](const std::string& stage, double share) {
    progress.show(stage, share);
    return true;
  };
  return applied(cell, batch, diagnosis, options);
}

/// The path of the extended list.
const std::string& extended_cell(const DiagnoseArguments& arguments) {
  return arguments.cell_out.empty() ? arguments.cell : arguments.cell_out;
}

std::string extension_written(const Extension& extension, const DiagnoseArguments& arguments) {
  const std::string& path = extended_cell(arguments);
  std::string said =
      fmt::format("{}: error_sources: [{}]\n", path, fmt::join(extension.lasting, ", "));
  if (extension.lasting.size() < extension.sources.size()) {
    said += "  (what began at a pose of this batch is in the model, not in the cell file)\n";
  }
  if (const Result<Cell> readable = read_cell(path); !readable) {
    said += fmt::format(
        "  (it names its robot relative to itself, and is no cell file where it is: {})\n",
        sentence(readable.error()));
  }
  if (!arguments.model.empty()) {
    said += fmt::format("model {} in {}\n", extension.after.provenance().id, arguments.model);
  }
  return said;
}

/// Extends the model by the causes found. Writes it only if a service would put it in force.
Result<Applied> apply(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                      const Diagnosis& diagnosis, const DiagnoseArguments& arguments,
                      ordered_json& json, Outputs& outputs) {
  Result<Applied> found = run_extension(cell, batch, diagnosis, arguments.seed);
  if (!found || !found->extension) return found;
  const Extension& extension = *found->extension;
  json["applied"] = extension_json(extension);
  json["notes"] = notes_json(notes_of(extension.after));
  say(extension_text(extension), arguments);
  if (!found->why_not.empty()) {
    found->why_not = fmt::format("cell {}: {}", cell->name, found->why_not);
    return found;
  }
  std::string text = TRY(with_error_sources(cell->cell_yaml, extension.lasting, arguments.cell));
  outputs.put(kCellOption, std::move(text));
  outputs.put("--model", serialize(extension.after));
  return found;
}

/// The batch to diagnose. With --apply some rows are held out, to judge the extended model.
Result<CheckedBatch> batch_to_diagnose(const DiagnoseArguments& arguments, const Cell& cell) {
  return read_checked_batches(
      arguments.batches, cell,
      arguments.apply ? held_out_to_extend(arguments.seed) : drawn(0, arguments.seed));
}

/// Reports the applied causes, or the reason why none was applied.
Extent tell_applied(const Applied& applied, const DiagnoseArguments& arguments) {
  if (applied.why_not.empty()) {
    say(extension_written(*applied.extension, arguments), arguments);
    return Extent::kAll;
  }
  fmt::print(stderr, "not applied: {}; cell file and model were not written\n", applied.why_not);
  return Extent::kPart;
}

/// Reports the effect of the repair since the model of --since; returns its section of the page.
Result<std::string> tell_since(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                               const DiagnoseArguments& arguments, ordered_json& json) {
  if (arguments.since.empty()) return std::string();
  const CompensatedModel before = TRY(load_model(arguments.since));
  const AfterRepair repair = TRY(did_it_help(before, cell, batch));
  json["since"] = after_repair_json(repair);
  std::string text = "\n";
  for (const std::string& line : in_words(repair)) text += line + "\n";
  say(text, arguments);
  return after_repair_section(repair);
}

Result<Extent> diagnose_files(const DiagnoseArguments& arguments) {
  if (arguments.batches.empty())
    return failure(ErrorCode::kUsage, "--batch is required").of("--batch");
  Outputs outputs = outputs_of(arguments);
  if (arguments.apply) outputs.add(kCellOption, extended_cell(arguments), "--cell");
  outputs.add("--model", arguments.model);
  std::vector<NamedFile> inputs = {{"--cell", arguments.cell}};
  for (const std::string& path : arguments.batches) inputs.push_back({"--batch", path});
  if (!arguments.since.empty()) inputs.push_back({"--since", arguments.since});
  TRY(outputs.check(inputs));
  Cell read = TRY(read_cell_to_train(arguments.cell));
  const auto cell = std::make_shared<const Cell>(std::move(read));
  const CheckedBatch batch = TRY(batch_to_diagnose(arguments, *cell));
  const Result<Diagnosis> diagnosis = run_diagnosis(cell, batch, arguments);
  if (!diagnosis) return tl::make_unexpected(with_rows_set_aside(diagnosis.error(), batch));
  const std::vector<Note> notes = notes_of(*cell);
  warn_of_notes(notes);
  ordered_json json = diagnosis_json(*diagnosis, notes);
  say(diagnosis_text(json), arguments);
  const std::string after_repair = TRY(tell_since(cell, batch, arguments, json));
  std::optional<Result<Applied>> applied;
  if (arguments.apply) applied = apply(cell, batch, *diagnosis, arguments, json, outputs);
  TRY(write_diagnosis(json, diagnosis_page(*diagnosis, *cell, after_repair), outputs, arguments));
  if (!applied) return leaves_open(json, arguments) ? Extent::kPart : Extent::kAll;
  if (!*applied) return tl::make_unexpected(applied->error());
  return tell_applied(**applied, arguments);
}

Result<Extent> diagnose_by_service(const DiagnoseArguments& arguments) {
  if (arguments.prove)
    return failure(ErrorCode::kUsage, "--prove is for files").of("--prove").next(kProveOnFiles);
  if (!arguments.since.empty())
    return failure(ErrorCode::kUsage,
                   "a service diagnoses by its own model and takes no model file to compare with")
        .of("--since")
        .next(kSinceOnFiles);
  return diagnose_at_service(arguments).map(
      [](bool all) { return all ? Extent::kAll : Extent::kPart; });
}

void add_prove_options(CLI::App& command, DiagnoseArguments& arguments) {
  CLI::Option* prove = command.add_flag(
      "--prove", arguments.prove,
      "On files: put effects of several sizes into what the best model leaves over of this batch, "
      "diagnose them, and tell from which size on each cause is named");
  command
      .add_option("--prove-minutes", arguments.prove_minutes,
                  "With --prove: time to take, on all processors; what is not decided by then says "
                  "so")
      ->type_name("MINUTES")
      ->check(CLI::PositiveNumber)
      ->capture_default_str()
      ->needs(prove);
}

}  // namespace

void say(const std::string& text, const DiagnoseArguments& arguments) {
  tell(text, {arguments.json, arguments.report, arguments.next_poses, arguments.cell_out});
}

Outputs outputs_of(const DiagnoseArguments& arguments) {
  Outputs outputs;
  outputs.add("--report", arguments.report);
  outputs.add("--next-poses", arguments.next_poses);
  outputs.add("--json", arguments.json);
  return outputs;
}

Status write_diagnosis(const ordered_json& json, std::string page, Outputs& outputs,
                       const DiagnoseArguments& arguments) {
  const bool poses = !json.at("next_poses").empty();
  if (poses) outputs.put("--next-poses", next_poses_csv(json));
  outputs.put("--report", with_pages_beside(std::move(page), arguments.report));
  outputs.put("--json", json_text(json));
  TRY(outputs.write());
  if (!poses && !arguments.next_poses.empty()) {
    fmt::print(stderr, "{}: not written, no poses are suggested: {}\n", shown(arguments.next_poses),
               shown_lines(json.at("next_poses_for").at("none_because").get<std::string>()));
  }
  return {};
}

void add_diagnose_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<DiagnoseArguments>();
  CLI::App* command = app.add_subcommand(
      "diagnose",
      "Tell which physical cause the model lacks, how sure that is, and what to measure next");
  command
      ->add_option("--cell", arguments->cell, "Cell file (YAML); with --service also the cell's id")
      ->required();
  command
      ->add_option("--batch", arguments->batches,
                   "Measurements (CSV: joints in deg, rails in mm; positions in mm), on files "
                   "again for each measuring session; with --service also the id of a batch that "
                   "the service has; left out there: its newest batch")
      ->allow_extra_args(false);
  command
      ->add_option("--report", arguments->report, "Page to write (HTML); opens without a network")
      ->type_name("FILE");
  command
      ->add_option("--next-poses", arguments->next_poses,
                   "Plan to write (CSV: joints in deg, rails in mm) of poses that tell apart what "
                   "this batch cannot. Where there are none nothing is written, the reason goes to "
                   "standard error, and the exit code is 0")
      ->type_name("FILE");
  command->add_flag("--strict", arguments->strict,
                    "Exit with 1, not 0, where the model lacks something that is not applied");
  add_seed_option(*command, arguments->seed, "Seed of the bootstrap and of the rows held out");
  CLI::Option* apply_flag = command->add_flag(
      "--apply", arguments->apply,
      "Add what was found to the cell's error sources and train. Cell file and model are written, "
      "with --service put in force, only where poses held out gain by it beyond chance");
  command
      ->add_option("--model", arguments->model,
                   "With --apply, on files: extended model file to write")
      ->needs(apply_flag);
  command
      ->add_option("--cell-out", arguments->cell_out,
                   "With --apply, on files: cell file to write instead of --cell itself")
      ->needs(apply_flag);
  command
      ->add_option(
          "--since", arguments->since,
          "On files: model file from before a repair; tells whether the repair helped, line "
          "by line of its error budget")
      ->type_name("FILE");
  add_prove_options(*command, *arguments);
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback([arguments, &chosen] {
    chosen = [arguments]() -> Result<Extent> {
      if (!arguments->service.service) return diagnose_files(*arguments);
      return diagnose_by_service(*arguments);
    };
  });
}

}  // namespace trammel::cli
