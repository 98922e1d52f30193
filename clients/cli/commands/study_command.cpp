#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/shipped_files.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/study_text.h"

namespace trammel::cli {

namespace {

struct StudyArguments {
  std::string name, json;
  std::string cell, truth;  // empty: the shipped ones
  std::optional<std::string> bias;
  std::uint64_t seed = 1;
};

Result<VirtualRobot> robot_to_study(const StudyArguments& arguments) {
  Cell cell =
      TRY(read_cell(arguments.cell.empty() ? shipped_file("config/cell-7.yaml") : arguments.cell));
  return read_virtual_robot(
      arguments.truth.empty() ? shipped_file("models/truth/chapter-5.yaml") : arguments.truth,
      std::make_shared<const Cell>(std::move(cell)));
}

Result<std::vector<TargetRow>> holes_to_drill(const Chain& robot) {
  TargetFile file = TRY(read_targets_csv(shipped_file("config/drill-panel.csv")));
  TRY(check_targets(file, robot));
  return std::move(file.rows);
}

Status run(const StudyArguments& arguments) {
  const VirtualRobot robot = TRY(robot_to_study(arguments));
  StudyOptions options;
  options.seed = arguments.seed;
  options.bias = arguments.bias;
  if (arguments.name == "drilling") {
    std::vector<TargetRow> holes = TRY(holes_to_drill(robot.truth.cell->robot));
    options.holes = std::move(holes);
  }
  const Study study = TRY([&] {
    ProgressLine progress;
    options.progress = [&](const std::string& stage, double share) {
      progress.show(stage, share);
      return true;
    };
    return run_study(arguments.name, robot, options);
  }());
  tell(study_text(study), {arguments.json});
  return write_json(arguments.json, study_json(study));
}

}  // namespace

void add_study_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<StudyArguments>();
  CLI::App* command = app.add_subcommand(
      "study",
      "Repeat a study of the thesis on the shipped virtual robot: its figures beside ours, mm");
  command->add_option("name", arguments->name, "Which study")
      ->required()
      ->check(CLI::IsMember(study_names()));
  command->add_option("--cell", arguments->cell, "Cell file (YAML) instead of the shipped one")
      ->type_name("FILE");
  command
      ->add_option("--truth", arguments->truth,
                   "Truth file (YAML) of the virtual robot instead of the shipped one")
      ->type_name("FILE");
  add_seed_option(*command, arguments->seed, "Seed of all draws: poses, noise, search");
  command->add_option("--bias", arguments->bias,
                      "Kernel of the learned bias instead of the cell's, as train spells it");
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return run(*arguments); }; });
}

}  // namespace trammel::cli
