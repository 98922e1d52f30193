#include <CLI/CLI.hpp>
#include <filesystem>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/rigid_robot.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/robot_text.h"
#include "server/compensate/model_file.h"

namespace trammel::cli {

namespace {

struct RobotArguments {
  std::string model, output, table, json;
  ServiceOptions service;
};

Status export_robot(const RobotArguments& arguments) {
  const std::string ending = std::filesystem::path(arguments.output).extension().string();
  const bool yaml = ending == ".yaml" || ending == ".yml";
  if (!yaml && ending != ".urdf" && arguments.output != "-") {
    return failure(ErrorCode::kUsage, "unknown kind of robot '{}'", ending)
        .in(arguments.output)
        .of("--output")
        .with_text(ending)
        .next("end the name with .urdf or .yaml");
  }
  Outputs outputs;
  outputs.add("--output", arguments.output);
  outputs.add("--table", arguments.table);
  outputs.add("--json", arguments.json);
  TRY(outputs.check({{"--model", arguments.model}}));
  const CompensatedModel model = TRY(model_named(arguments.model, arguments.service));
  const RigidRobot robot = rigid_robot(model);
  outputs.put("--output", yaml ? robot_yaml_text(model, robot) : urdf_text(model, robot));
  outputs.put("--table", robot_table(model, robot));
  outputs.put("--json", json_text(robot_json(model, robot)));
  TRY(outputs.write());
  tell(fmt::format("robot of model {} in {}\n{}", model.provenance().id, arguments.output,
                   left_out_text(robot)),
       {arguments.output, arguments.table, arguments.json});
  return {};
}

}  // namespace

void add_robot_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<RobotArguments>();
  CLI::App* command = app.add_subcommand(
      "export-robot",
      "Write the calibrated robot for other programs, and how much they cannot carry, mm");
  add_model_option(*command, arguments->model);
  command
      ->add_option(
          "-o,--output", arguments->output,
          "Robot to write: URDF (.urdf; '-': standard output) or a robot file of ours (.yaml)")
      ->required();
  command->add_option(
      "--table", arguments->table,
      "Also write nominal and calibrated parameters (CSV: mm, deg) with their uncertainty");
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return export_robot(*arguments); }; });
}

}  // namespace trammel::cli
