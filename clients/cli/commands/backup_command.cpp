#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>

#include "clients/cam/backup/backup.h"
#include "clients/cli/commands/commands.h"
#include "clients/cli/files/backup_files.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/robot/cell.h"
#include "server/robot/cell_rules.h"
#include "server/robot/robot_file.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct BackupArguments {
  std::string backup, robot, robot_output, cell, unit, task, compare, output, frames, json;
};

ordered_json as_json(const cam::ControllerCell& controller,
                     const std::vector<std::string>& differing) {
  ordered_json tools = ordered_json::array(), frames = ordered_json::array(),
               loads = ordered_json::array();
  for (const auto& [name, tool] : controller.tools) tools.push_back(name);
  for (const auto& [name, X_BO] : controller.frames) frames.push_back(name);
  for (const auto& [name, load] : controller.loads) loads.push_back(name);
  ordered_json factory = ordered_json::array();
  for (const cam::FactoryValue& one : controller.factory)
    factory.push_back({{"part", one.part},
                       {"axis", one.axis},
                       {"name", one.name},
                       {"value", one.value},
                       {"unit", one.unit}});
  return {{"unit", controller.unit},
          {"robot_type", controller.robot_type},
          {"controller_compensates", controller.controller_compensates},
          {"tools", tools},
          {"work_objects", frames},
          {"loads", loads},
          {"factory", factory},
          {"notes", controller.notes},
          {"differences", differing}};
}

std::string in_words(const cam::ControllerCell& controller, const BackupArguments& arguments,
                     const std::vector<std::string>& differing) {
  std::string text = fmt::format(
      "{} ({}): {} tools, {} work objects, {} loads; the controller's own calibration is {}\n",
      controller.unit, controller.robot_type, controller.tools.size(), controller.frames.size(),
      controller.loads.size(), controller.controller_compensates ? "in use" : "not in use");
  for (const std::string& note : controller.notes) text += "note: " + note + "\n";
  if (arguments.compare.empty()) return text;
  for (const std::string& one : differing) text += "differs: " + one + "\n";
  return text + (differing.empty() ? fmt::format("{} has all of it\n", arguments.compare) : "");
}

/// The path of the robot file for the cell file: relative to it, unless the cell goes to standard
/// output.
std::string robot_in(const std::string& cell, const std::string& robot_path) {
  std::error_code error;
  const fs::path robot = fs::absolute(robot_path, error);
  if (cell == "-") return robot.string();
  const fs::path relative = fs::relative(robot, fs::absolute(cell, error).parent_path(), error);
  return relative.empty() ? robot.string() : relative.string();
}

/// Adds the advice to choose the modules, unless the user has chosen them.
Error advised(Error error, const BackupArguments& arguments) {
  if (error.field == "tooldata" && error.next.empty())
    error.next = arguments.task.empty() ? "--task says of which task they are taken"
                                        : "take the module that is not used out of the backup";
  return error;
}

Status check_usage(const BackupArguments& arguments) {
  if (arguments.output.empty() && arguments.compare.empty() && arguments.frames.empty())
    return failure(ErrorCode::kUsage, "nothing to do")
        .of("--output")
        .next("--output writes a cell, --compare compares one");
  if (arguments.output != "-") return {};
  if (arguments.cell.empty() || (arguments.robot.empty() && arguments.robot_output.empty()))
    return failure(ErrorCode::kUsage,
                   "a cell on standard output needs --name, and --robot or --robot-output")
        .of("--output");
  return {};
}

/// The robot of the cell: a file that is there, or one that is written.
struct RobotOfCell {
  Chain chain;
  std::string path, text;
  bool is_new = false;
};

/// Beside the cell: `cell-robot.yaml`.
std::string robot_beside(const std::string& cell) {
  const fs::path path(cell);
  return (path.parent_path() / (path.stem().string() + "-robot.yaml")).string();
}

Result<RobotOfCell> robot_of(const BackupArguments& arguments,
                             const cam::ControllerCell& controller) {
  if (!arguments.robot.empty()) {
    std::string text = TRY(read_text_file(arguments.robot));
    Chain chain = TRY(parse_robot(text, arguments.robot));
    return RobotOfCell{std::move(chain), arguments.robot, std::move(text)};
  }
  const BackupRobot found = TRY(robot_of_backup(controller));
  const std::string path =
      arguments.robot_output.empty() ? robot_beside(arguments.output) : arguments.robot_output;
  return RobotOfCell{found.arm, path, robot_yaml(found.arm, found.source), true};
}

/// The cell file and its robot file, as far as the user requests them. Empty if they could not be
/// read back.
Result<std::vector<OutputText>> cell_texts(const BackupArguments& arguments,
                                           const cam::ControllerCell& controller) {
  std::vector<OutputText> texts;
  if (arguments.output.empty()) return texts;
  if (controller.tools.empty()) {
    return refused("no tool in the modules of the backup, a cell needs one")
        .in(arguments.backup)
        .of("tooldata")
        .next("--task may have left out the modules that have it");
  }
  const RobotOfCell robot = TRY(robot_of(arguments, controller));
  TRY(cam::check_robot(controller, robot.chain));
  const std::string name =
      arguments.cell.empty() ? fs::path(arguments.output).stem().string() : arguments.cell;
  std::string text = cam::cell_file_of(controller, {name, robot_in(arguments.output, robot.path)});
  TRY(parse_cell(text, robot.text, arguments.output));
  if (robot.is_new) texts.push_back({"--robot-output", robot.path, robot.text});
  texts.push_back({"--output", arguments.output, std::move(text)});
  return texts;
}

Result<std::vector<std::string>> differences_from_cell(const BackupArguments& arguments,
                                                       const cam::ControllerCell& controller) {
  if (arguments.compare.empty()) return std::vector<std::string>{};
  const Cell cell = TRY(read_cell(arguments.compare));
  TRY(cam::check_robot(controller, cell.robot));
  const CellRules rules = TRY(rules_of(cell));
  return cam::differences(controller, cell, rules.controller_compensates);
}

Result<Extent> import_backup(const BackupArguments& arguments) {
  TRY(check_usage(arguments));
  const auto controller = read_controller({arguments.backup, arguments.unit, arguments.task});
  if (!controller) return tl::make_unexpected(advised(controller.error(), arguments));
  if (!arguments.robot.empty()) {
    const Chain robot = TRY(read_robot(arguments.robot));
    TRY(cam::check_robot(*controller, robot));
  }
  const std::vector<std::string> differing = TRY(differences_from_cell(arguments, *controller));
  std::vector<OutputText> texts = TRY(cell_texts(arguments, *controller));
  texts.push_back({"--frames", arguments.frames, frames_csv(*controller)});
  TRY(write_together(texts));
  tell(in_words(*controller, arguments, differing),
       {arguments.output, arguments.robot_output, arguments.frames, arguments.json});
  TRY(write_json(arguments.json, as_json(*controller, differing)));
  return differing.empty() ? Extent::kAll : Extent::kPart;
}

}  // namespace

void add_backup_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<BackupArguments>();
  CLI::App* command = app.add_subcommand(
      "import-backup",
      "Make a cell of a controller's backup (ABB, KUKA, FANUC, Yaskawa), or tell where a cell "
      "differs");
  command
      ->add_option("backup", arguments->backup,
                   "Folder of the backup, with SYSPAR/MOC.cfg and RAPID (ABB), $machine.dat and "
                   "$config.dat (KUKA), SYSFRAME.VA (FANUC), TOOL.CND and UFRAME.CND (Yaskawa)")
      ->required();
  command->add_option("-o,--output", arguments->output,
                      "Cell file to write (YAML): base frame, tools, loads, axis ranges, whether "
                      "the controller's own calibration is in use");
  command->add_option("--name", arguments->cell,
                      "Cell id, for --output; the name of its file where none is given");
  command->add_option(
      "--robot", arguments->robot,
      "Robot file (YAML) that the cell file names, for --output; without it one is "
      "written: by the lengths that the controller tells (KUKA), else as the shipped "
      "robot of the type that it names");
  command->add_option("--robot-output", arguments->robot_output,
                      "Robot file to write (YAML) where --robot names none; beside the cell file "
                      "where none is given");
  command->add_option(
      "--compare", arguments->compare,
      "Cell file (YAML) to compare with; what differs is told, and the exit code is 1");
  command->add_option("--unit", arguments->unit,
                      "Robot of the backup, where it has several (ROB_1, ...)");
  command->add_option("--task", arguments->task,
                      "Task whose modules are read (TASK1, ...); all where none is given");
  command->add_option("--frames", arguments->frames,
                      "Work objects, seen from the robot's base, to write for --frames of correct "
                      "and predict (CSV)");
  add_json_option(*command, arguments->json);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return import_backup(*arguments); }; });
}

}  // namespace trammel::cli
