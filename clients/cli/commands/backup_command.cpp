#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>

#include "clients/cam/backup/backup.h"
#include "clients/cli/commands/commands.h"
#include "clients/cli/files/controller_files.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/robot/cell_rules.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct BackupArguments {
  std::string backup, robot, cell, unit, task, compare, output, frames, json;
};

/// The entry of a folder with this name, whatever its case: backups are copied by all kinds of
/// systems.
std::string inside(const std::string& folder, const std::string& name) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (lower(entry.path().filename().string()) == lower(name)) return entry.path().string();
  }
  return (fs::path(folder) / name).string();
}

Result<std::vector<cam::SourceFile>> modules_of(const BackupArguments& arguments) {
  const std::string rapid = inside(arguments.backup, "RAPID");
  const std::string folder = arguments.task.empty() ? rapid : inside(rapid, arguments.task);
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    if (arguments.task.empty()) return std::vector<cam::SourceFile>{};
    return refused("no task {} in the backup", shown(arguments.task))
        .in(folder)
        .of("--task")
        .with_text(arguments.task);
  }
  bool any = false;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder, error))
    any |= cam::dialect_of_file(entry.path().string()) == cam::Dialect::kRapid;
  if (!any) return std::vector<cam::SourceFile>{};
  ProgramFiles files = TRY(read_program_files({folder}, cam::name_of(cam::Dialect::kRapid)));
  return std::move(files.files);
}

/// As --frames of `correct` reads it. A program uses a few of them.
std::string frames_csv(const cam::ControllerCell& controller) {
  std::string text = "name,x_mm,y_mm,z_mm,qw,qx,qy,qz,may_be_unused\n";
  const auto add = [&](const std::string& name, const Pose& X) {
    const Vector3 p = X.translation() * to_mm(1);
    const Eigen::Quaterniond q(X.linear());
    text += csv_field(name);
    for (const double value : {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()})
      text += "," + csv_number(value);
    text += ",yes\n";
  };
  add(cam::kRobotBase, controller.X_WB);
  for (const auto& [name, X_BO] : controller.frames) add(name, X_BO);
  return text;
}

ordered_json as_json(const cam::ControllerCell& controller,
                     const std::vector<std::string>& differing) {
  ordered_json tools = ordered_json::array(), frames = ordered_json::array(),
               loads = ordered_json::array();
  for (const auto& [name, tool] : controller.tools) tools.push_back(name);
  for (const auto& [name, X_BO] : controller.frames) frames.push_back(name);
  for (const auto& [name, load] : controller.loads) loads.push_back(name);
  return {{"unit", controller.unit},
          {"robot_type", controller.robot_type},
          {"controller_compensates", controller.controller_compensates},
          {"tools", tools},
          {"work_objects", frames},
          {"loads", loads},
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

/// The robot file as it is to stand in the cell file: relative to it, unless the cell goes to
/// standard output.
std::string robot_in(const BackupArguments& arguments) {
  std::error_code error;
  const fs::path robot = fs::absolute(arguments.robot, error);
  if (arguments.output.empty() || arguments.output == "-") return robot.string();
  const fs::path relative =
      fs::relative(robot, fs::absolute(arguments.output, error).parent_path(), error);
  return relative.empty() ? robot.string() : relative.string();
}

/// The dialect of another maker's backup, by the names of files that only his controllers have.
std::optional<cam::Dialect> dialect_of(const std::string& folder) {
  const auto has = [&](const std::string& file, cam::Dialect dialect) {
    return cam::own_lists_of(dialect).contains(file) || cam::dialect_of_file(file) == dialect;
  };
  std::error_code error;
  std::vector<std::string> files;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error))
    files.push_back(lower(it->path().filename().string()));
  for (const cam::Dialect dialect :
       {cam::Dialect::kKrl, cam::Dialect::kFanuc, cam::Dialect::kInform}) {
    if (std::any_of(files.begin(), files.end(),
                    [&](const std::string& file) { return has(file, dialect); }))
      return dialect;
  }
  return std::nullopt;
}

Result<cam::ControllerCell> controller_of(const BackupArguments& arguments) {
  const std::string moc = inside(inside(arguments.backup, "SYSPAR"), "MOC.cfg");
  const Result<std::string> parameters = read_text_file(moc);
  const auto dialect = parameters ? std::nullopt : dialect_of(arguments.backup);
  if (dialect)
    return cam::read_own_lists(*dialect,
                               TRY(files_called(cam::own_lists_of(*dialect), arguments.backup)));
  if (!parameters) return tl::make_unexpected(parameters.error());
  return cam::read_backup(*parameters, moc, TRY(modules_of(arguments)), arguments.unit);
}

/// Which modules to take is for whoever asks to say, unless he has.
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
  if (!arguments.output.empty() && (arguments.robot.empty() || arguments.cell.empty()))
    return failure(ErrorCode::kUsage, "a cell needs --robot and --name").of("--output");
  return {};
}

Result<Extent> import_backup(const BackupArguments& arguments) {
  TRY(check_usage(arguments));
  const auto controller = controller_of(arguments);
  if (!controller) return tl::make_unexpected(advised(controller.error(), arguments));
  if (!arguments.robot.empty()) {
    const Chain robot = TRY(read_robot(arguments.robot));
    TRY(cam::check_robot(*controller, robot));
  }
  std::vector<std::string> differing;
  if (!arguments.compare.empty()) {
    const Cell cell = TRY(read_cell(arguments.compare));
    TRY(cam::check_robot(*controller, cell.robot));
    const CellRules rules = TRY(rules_of(cell));
    differing = cam::differences(*controller, cell, rules.controller_compensates);
  }
  if (!arguments.output.empty()) {
    if (controller->tools.empty()) {
      return refused("no tool in the modules of the backup, a cell needs one")
          .in(arguments.backup)
          .of("tooldata")
          .next("--task may have left out the modules that have it");
    }
    const std::string text = cam::cell_file_of(*controller, arguments.cell, robot_in(arguments));
    TRY(write_output(arguments.output, text));
  }
  if (!arguments.frames.empty()) {
    TRY(write_output(arguments.frames, frames_csv(*controller)));
  }
  tell(in_words(*controller, arguments, differing),
       {arguments.output, arguments.frames, arguments.json});
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
  command->add_option("--name", arguments->cell, "Cell id, for --output");
  command->add_option("--robot", arguments->robot,
                      "Robot file (YAML) that the cell file names, for --output");
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
