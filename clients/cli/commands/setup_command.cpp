#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "clients/cam/backup/backup.h"
#include "clients/cam/stated_robot.h"
#include "clients/cli/commands/commands.h"
#include "clients/cli/files/backup_files.h"
#include "clients/cli/files/plan_csv.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/plan/measuring_program.h"
#include "server/plan/plan.h"
#include "server/plan/travel.h"
#include "server/robot/cell.h"
#include "server/robot/robot_file.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct SetupArguments {
  std::string folder, output, robot, cell, unit, task, tool, json;
  std::vector<double> workspace_mm;
  int count = 60;
  std::uint64_t seed = 1;
};

/// What the folder states about the cell, and what is missing.
struct Proposal {
  cam::ControllerCell controller;
  cam::Dialect dialect = cam::Dialect::kRapid;
  std::optional<cam::Program> program;
  std::optional<BackupRobot> robot;  ///< empty: --robot names it
  Chain arm;
  std::string robot_path, robot_text;  ///< the path as the cell file has it
  std::string tool, payload;           ///< that is measured with; no payload: empty
  std::vector<std::string> missing;    ///< a sentence each, with what to do about it
};

/// How often motions of the program go somewhere with the tool, whatever they call it.
std::size_t uses_of(const cam::StatedTool& tool, const cam::Program& program) {
  std::size_t uses = 0;
  for (const cam::ProgramTarget& target : program.targets) {
    const std::optional<Pose>& X_FT = program.tools[target.tool].X_FT;
    if (X_FT && cam::same_place(*X_FT, tool.X_FT))
      uses += std::max<std::size_t>(target.used_at.size(), 1);
  }
  return uses;
}

Result<cam::Program> program_in(const SetupArguments& arguments, cam::Dialect& dialect) {
  const ProgramFiles files = TRY(read_program_files({arguments.folder}, "", arguments.task));
  dialect = files.dialect;
  cam::ReadOptions options;
  options.spared = files.system;
  return understood_program(files, std::move(options), "");
}

/// Uses the controller's own files if the folder has them, else its program.
Result<Proposal> read_folder(const SetupArguments& arguments) {
  Proposal proposal;
  Result<cam::Program> program = program_in(arguments, proposal.dialect);
  if (is_backup(arguments.folder)) {
    proposal.controller = TRY(read_controller({arguments.folder, arguments.unit, arguments.task}));
    proposal.dialect = maker_of(arguments.folder).value_or(proposal.dialect);
  } else {
    if (!program) return tl::make_unexpected(program.error());
    proposal.controller = cam::cell_of_program(*program);
  }
  if (program)
    proposal.program = std::move(*program);
  else
    proposal.missing.push_back("no program was looked at: " + sentence(program.error()));
  if (proposal.controller.tools.empty())
    return refused("no tool with its numbers in it, a cell needs one")
        .in(arguments.folder)
        .next("add the controller's own lists ($config.dat, SYSFRAME.VA, TOOL.CND) to the folder");
  return proposal;
}

Status find_robot(const SetupArguments& arguments, Proposal& proposal) {
  if (arguments.robot.empty()) {
    proposal.robot = TRY(robot_of_backup(proposal.controller));
    proposal.arm = proposal.robot->arm;
    proposal.robot_path = "robot.yaml";
    proposal.robot_text = robot_yaml(proposal.arm, proposal.robot->source);
  } else {
    std::error_code error;
    proposal.robot_text = TRY(read_text_file(arguments.robot));
    proposal.arm = TRY(parse_robot(proposal.robot_text, arguments.robot));
    const fs::path robot = fs::absolute(arguments.robot, error);
    const fs::path relative = fs::relative(robot, fs::absolute(arguments.output, error), error);
    proposal.robot_path = relative.empty() ? robot.string() : relative.string();
  }
  return cam::check_robot(proposal.controller, proposal.arm);
}

/// The tool that is asked for, else the one that most motions use, and its load.
Status choose_tool(const SetupArguments& arguments, Proposal& proposal) {
  const auto& tools = proposal.controller.tools;
  if (!arguments.tool.empty() && !tools.contains(arguments.tool))
    return failure(ErrorCode::kUsage, "the folder tells of no tool '{}'", shown(arguments.tool))
        .of("--tool")
        .with_text(arguments.tool);
  proposal.tool = arguments.tool;
  std::size_t most = 0;
  for (const auto& [name, tool] : tools) {
    const std::size_t uses = proposal.program ? uses_of(tool, *proposal.program) : 0;
    if (!arguments.tool.empty() || (!proposal.tool.empty() && uses <= most)) continue;
    proposal.tool = name;
    most = uses;
  }
  std::vector<std::string> loads;
  for (const auto& [name, tool] : tools)
    if (tool.load) loads.push_back(name);
  for (const auto& [name, load] : proposal.controller.loads)
    if (!tools.contains(name)) loads.push_back(name);
  const bool own = std::find(loads.begin(), loads.end(), proposal.tool) != loads.end();
  if (own || !loads.empty()) proposal.payload = own ? proposal.tool : loads.front();
  if (!own && !loads.empty())
    proposal.missing.push_back(
        fmt::format("tool {} has no load there: {} is planned for; write its payload into the cell "
                    "file",
                    shown(proposal.tool), shown(proposal.payload)));
  return {};
}

/// As it is asked for, else as far as the arm reaches, above its mounting plane.
Result<Workspace> workspace_of(const SetupArguments& arguments, const Proposal& proposal) {
  constexpr std::size_t kCorners = 6;
  constexpr double kAbovePlane = 0.1;  // m
  const std::vector<double>& box = arguments.workspace_mm;
  if (!box.empty()) {
    if (box.size() != kCorners || !(box[0] < box[3] && box[1] < box[4] && box[2] < box[5]))
      return failure(ErrorCode::kUsage, "expected X,Y,Z of the lower corner and of the upper one")
          .of("--workspace");
    return Workspace{Vector3(box[0], box[1], box[2]) * from_mm(1),
                     Vector3(box[3], box[4], box[5]) * from_mm(1)};
  }
  double reach = 0;
  for (int j = 0; j < proposal.arm.size(); ++j)
    reach += std::hypot(proposal.arm.joint(j).link.a, proposal.arm.joint(j).link.d);
  for (const auto& [name, tool] : proposal.controller.tools)
    reach = std::max(reach, reach + tool.X_FT.translation().norm());
  reach = std::ceil(reach * 10) / 10;
  return Workspace{{-reach, -reach, kAbovePlane}, {reach, reach, reach}};
}

void add_missing(const SetupArguments& arguments, Proposal& proposal) {
  std::vector<std::string>& missing = proposal.missing;
  missing.push_back(fmt::format(
      "nobody has compared robot file and robot: six poses that the controller shows, and trammel "
      "confirm-robot --cell {}/cell.yaml --poses shown.csv",
      arguments.output));
  missing.emplace_back(
      "the instrument is not known: tracker: {sigma_mm: ...} in the cell file; 0.013 mm is taken");
  if (arguments.workspace_mm.empty())
    missing.emplace_back(
        "nobody told of fences and tables: the tool's point stays 100 mm above the mounting plane, "
        "the rest is not looked at; --workspace X,Y,Z,X,Y,Z bounds it");
  if (proposal.dialect == cam::Dialect::kInform)
    missing.emplace_back("no measuring program is written for INFORM: plan.csv has the joints");
  if (!proposal.program) return;
  for (const std::string& row : cam::rows_of(*proposal.program).open)
    missing.push_back(
        fmt::format("{} is not in the folder: a row of --frames tells it", shown(row)));
  if (!proposal.program->left.empty())
    missing.push_back(
        fmt::format("{} targets of the program would be left, {} corrected: the "
                    "receipt of correct says why",
                    proposal.program->left.size(), proposal.program->targets.size()));
}

/// The number behind the name of a FANUC tool, `UTOOL[2]`.
int number_in_brackets(const std::string& name, int otherwise) {
  const std::size_t bracket = name.find('[');
  return bracket == std::string::npos ? otherwise : std::atoi(name.c_str() + bracket + 1);
}

/// The plan as a program for the controller; empty: none is written for it.
Result<OutputText> program_text(const SetupArguments& arguments, const Proposal& proposal,
                                const Plan& plan) {
  const fs::path folder = arguments.output;
  ProgramOptions options;
  switch (proposal.dialect) {
    case cam::Dialect::kRapid:
      options.rapid_tool = proposal.tool;
      return OutputText{"program", (folder / "measure.mod").string(),
                        TRY(to_rapid(proposal.arm, plan, options))};
    case cam::Dialect::kKrl: {
      constexpr int kMostTools = 16;
      const int number = proposal.controller.tools.at(proposal.tool).number;
      options.krl_tool = number > kMostTools ? 0 : number;
      return OutputText{"program", (folder / "measure.src").string(),
                        TRY(to_krl(proposal.arm, plan, options))};
    }
    case cam::Dialect::kFanuc:
      options.fanuc_tool = number_in_brackets(proposal.tool, options.fanuc_tool);
      return OutputText{"program", (folder / "measure.ls").string(),
                        TRY(to_fanuc(proposal.arm, plan, options))};
    case cam::Dialect::kUrScript:
      return OutputText{"program", (folder / "measure.script").string(),
                        TRY(to_urscript(proposal.arm, plan, options))};
    case cam::Dialect::kInform:
    case cam::Dialect::kCamRob:
    case cam::Dialect::kRoboDk:
      break;
  }
  return OutputText{};
}

Result<Plan> plan_for(const SetupArguments& arguments, const Proposal& proposal,
                      const std::shared_ptr<const Cell>& cell) {
  PlanOptions options;
  options.count = arguments.count;
  options.seed = arguments.seed;
  options.tools = {proposal.tool};
  if (!proposal.payload.empty()) options.payloads = {proposal.payload};
  Plan plan = TRY(make_plan(cell, options));
  return ordered_for_travel(cell->robot, std::move(plan));
}

/// All files of the new cell.
Result<std::vector<OutputText>> files_of(const SetupArguments& arguments,
                                         const Proposal& proposal) {
  const fs::path folder = arguments.output;
  const std::string path = (folder / "cell.yaml").string();
  const Workspace workspace = TRY(workspace_of(arguments, proposal));
  const std::string text = cam::cell_file_of(
      proposal.controller, {arguments.cell, proposal.robot_path, true, workspace});
  Cell read = TRY(parse_cell(text, proposal.robot_text, path));
  const auto cell = std::make_shared<const Cell>(std::move(read));
  const Plan plan = TRY(plan_for(arguments, proposal, cell));
  std::vector<OutputText> files;
  if (proposal.robot)
    files.push_back({"robot", (folder / proposal.robot_path).string(), proposal.robot_text});
  files.push_back({"cell", path, text});
  const std::string csv = (folder / "plan.csv").string();
  files.push_back({"plan", csv, plan_csv(*cell, csv, plan)});
  OutputText program = TRY(program_text(arguments, proposal, plan));
  if (!program.path.empty()) files.push_back(std::move(program));
  return files;
}

/// What is typed next, in this order.
std::vector<std::string> next_commands(const SetupArguments& arguments) {
  const std::string& dir = arguments.output;
  return {fmt::format("trammel convert --points tracker.txt --joints {0}/plan.csv -o {0}/batch.csv",
                      dir),
          fmt::format("trammel train --cell {0}/cell.yaml --batch {0}/batch.csv -o {0}/cell.model",
                      dir),
          fmt::format("trammel report --model {0}/cell.model -o {0}/report.html", dir),
          fmt::format("trammel correct --model {0}/cell.model {1} -o {0}/corrected", dir,
                      arguments.folder)};
}

template <typename Named>
std::vector<std::string> names_of(const std::map<std::string, Named>& all) {
  std::vector<std::string> names;
  for (const auto& [name, value] : all) names.push_back(name);
  return names;
}

ordered_json as_json(const SetupArguments& arguments, const Proposal& proposal,
                     const std::vector<OutputText>& files) {
  ordered_json written = ordered_json::array();
  for (const OutputText& file : files) written.push_back(file.path);
  return {{"cell", arguments.cell},
          {"robot", proposal.arm.name()},
          {"robot_from", proposal.robot ? proposal.robot->source : arguments.robot},
          {"controller", cam::name_of(proposal.dialect)},
          {"tools", names_of(proposal.controller.tools)},
          {"tool", proposal.tool},
          {"work_objects", names_of(proposal.controller.frames)},
          {"loads", names_of(proposal.controller.loads)},
          {"targets", proposal.program ? proposal.program->targets.size() : 0},
          {"left", proposal.program ? proposal.program->left.size() : 0},
          {"missing", proposal.missing},
          {"notes", proposal.controller.notes},
          {"files", written},
          {"next", next_commands(arguments)}};
}

std::string in_words(const SetupArguments& arguments, const Proposal& proposal,
                     const std::vector<OutputText>& files) {
  const auto joined = [](const std::vector<std::string>& names) {
    return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
  };
  std::string text = fmt::format(
      "cell {}: {}\n  robot file: {}\n  tools: {} (measured with: {})\n  work objects: {}\n",
      arguments.cell, proposal.arm.name(),
      proposal.robot ? proposal.robot->source : arguments.robot,
      joined(names_of(proposal.controller.tools)), proposal.tool,
      joined(names_of(proposal.controller.frames)));
  for (const std::string& note : proposal.controller.notes) text += "note: " + note + "\n";
  for (const std::string& one : proposal.missing) text += "missing: " + one + "\n";
  for (const OutputText& file : files) text += "written: " + file.path + "\n";
  text += "next: run the measuring program slowly, with somebody at the stop, and measure; then\n";
  for (const std::string& command : next_commands(arguments)) text += "  " + command + "\n";
  return text;
}

/// Refuses to write over an existing cell, or into the folder of the backup that is read.
Status check_place(const SetupArguments& arguments) {
  std::error_code error;
  if (!fs::is_directory(arguments.folder, error))
    return refused("no folder of a program or a backup").in(arguments.folder).of("folder");
  const fs::path inside = fs::weakly_canonical(fs::absolute(arguments.output, error), error)
                              .lexically_relative(fs::canonical(arguments.folder, error));
  if (!inside.empty() && *inside.begin() != "..")
    return failure(ErrorCode::kUsage, "{} lies in the folder that is read", arguments.output)
        .of("--output")
        .with_text(arguments.output);
  if (fs::exists(fs::path(arguments.output) / "cell.yaml", error))
    return refused("there is a cell.yaml already")
        .in(arguments.output)
        .of("--output")
        .next("name another folder");
  return {};
}

Status setup(SetupArguments arguments) {
  TRY(check_place(arguments));
  while (arguments.output.size() > 1 && arguments.output.ends_with('/'))
    arguments.output.pop_back();
  if (arguments.cell.empty()) arguments.cell = fs::path(arguments.output).filename().string();
  Proposal proposal = TRY(read_folder(arguments));
  TRY(find_robot(arguments, proposal));
  TRY(choose_tool(arguments, proposal));
  add_missing(arguments, proposal);
  const std::vector<OutputText> files = TRY(files_of(arguments, proposal));
  std::error_code error;
  fs::create_directories(arguments.output, error);
  TRY(write_together(files));
  tell(in_words(arguments, proposal, files), {arguments.json});
  return write_json(arguments.json, as_json(arguments, proposal, files));
}

}  // namespace

void add_setup_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<SetupArguments>();
  CLI::App* command = app.add_subcommand(
      "setup",
      "Make a cell of a program or a backup: robot, tools, frames, loads, a measuring program, and "
      "what is missing");
  command
      ->add_option("folder", arguments->folder,
                   "Folder with the program, or the backup of the controller (import-backup)")
      ->required();
  command
      ->add_option("-o,--output", arguments->output,
                   "Folder to write cell.yaml, robot.yaml, plan.csv and the measuring "
                   "program into; it is made")
      ->type_name("FOLDER")
      ->required();
  command->add_option("--name", arguments->cell,
                      "Cell id; the name of the output folder where none is given");
  command->add_option("--robot", arguments->robot,
                      "Robot file (YAML), where the folder does not say which robot it is");
  command->add_option(
      "--tool", arguments->tool,
      "Tool that is measured with; the one that most motions use where none is given");
  command
      ->add_option("--workspace", arguments->workspace_mm,
                   "Box in the robot's base that the tool's point stays in while it is measured, "
                   "mm: X,Y,Z of its lower corner, X,Y,Z of its upper one")
      ->delimiter(',')
      ->type_name("X,Y,Z,X,Y,Z");
  command->add_option("--count", arguments->count, "Number of measuring poses")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  add_seed_option(*command, arguments->seed, "Seed of the draw");
  command->add_option("--unit", arguments->unit,
                      "Robot of an ABB backup, where it has several (ROB_1, ...)");
  command->add_option("--task", arguments->task,
                      "Task of an ABB backup whose modules are read (TASK1, ...)");
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return setup(*arguments); }; });
}

}  // namespace trammel::cli
