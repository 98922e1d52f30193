#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "clients/cam/nominal_targets.h"
#include "clients/cli/commands/commands.h"
#include "clients/cli/files/batch_files.h"
#include "clients/cli/files/cell_to_train.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/programs/model_tools.h"
#include "server/plan/clearance.h"
#include "server/report/pages_beside.h"
#include "server/report/view_page.h"
#include "server/robot/cell_rules.h"

namespace trammel::cli {

namespace {

struct ViewArguments {
  std::string cell, input, format, output, json;
};

Result<Viewed> viewed_plan(const Cell& cell, const std::string& path) {
  const JointList list = TRY(read_joint_file(path).and_then(
      [&](JointList read) { return check_against_cell(std::move(read), cell); }));
  Viewed viewed{std::filesystem::path(path).filename().string(), {}};
  for (const CommandedPose& pose : list.poses)
    viewed.poses.push_back({pose.pose_id, pose.context, true});
  return viewed;
}

/// The cell's tools, as far as its file knows them.
cam::CellTools tools_in(const Cell& cell) {
  cam::CellTools tools;
  for (const auto& [name, X_FT] : cell.tools)
    if (X_FT) tools.tools.emplace(name, *X_FT);
  tools.payloads = cell.payloads;
  tools.X_WB = cell.X_WB;
  if (const auto rules = rules_of(cell))
    tools.idle_axes.insert(rules->idle_axes.begin(), rules->idle_axes.end());
  return tools;
}

void add_target(const cam::Program& program, const cam::NominalTargets& nominal, std::size_t t,
                Viewed& viewed) {
  const cam::ProgramTarget& target = program.targets[t];
  const std::string place =
      fmt::format("{} {}:{}", target.name, program.files[target.file].name, target.line);
  const cam::NominalTarget& one = nominal.targets[t];
  if (!one.q) {
    viewed.left.push_back(place + ": " +
                          (one.why_not.empty() ? "no joints bring the tool there" : one.why_not));
    return;
  }
  ViewedPose pose{place, {}, false};
  pose.context.q = *one.q;
  pose.context.tool = nominal.tools[target.tool].tool;
  viewed.poses.push_back(std::move(pose));
}

/// The targets in the order in which the program moves to them.
Result<Viewed> viewed_program(const Cell& cell, const ViewArguments& arguments) {
  const ProgramFiles files = TRY(read_program_files({arguments.input}, arguments.format));
  cam::ReadOptions reading;
  reading.split = true;  // nothing is written, so a point may be used in several ways
  reading.pulses_per_deg = TRY(cam::pulses_of_job(cell));
  const cam::Program program = TRY(understood_program(files, reading, ""));
  const cam::ArmOfProgram arm(cell.robot);
  const cam::NominalTargets nominal =
      TRY(cam::nominal_targets(program, arm, tools_in(cell), "", "", cam::BareTools::kOfTheCell));
  Viewed viewed{std::filesystem::path(arguments.input).filename().string(), {}};
  for (const cam::ProgramMove& move : program.moves)
    for (const std::size_t t : move.targets) add_target(program, nominal, t, viewed);
  for (const cam::LeftAlone& one : program.left)
    viewed.left.push_back(
        fmt::format("{} {}:{}: {}", one.name, program.files[one.file].name, one.line, one.why));
  return viewed;
}

std::string view_text(const Cell& cell, const Viewed& viewed, const ViewArguments& arguments) {
  const ViewFindings found = view_findings(cell, viewed);
  if (viewed.poses.empty() && viewed.left.empty())
    return fmt::format("cell {} at its rest pose in {}\n", cell.name, arguments.output);
  return fmt::format(
      "{} poses of {} in {}: {} touch an obstacle, {} out of sight, {} outside the "
      "workspace, {} without joints\n{}",
      found.poses, viewed.what, arguments.output, found.touching, found.unseen, found.outside,
      viewed.left.size(),
      obstacles_in_words(cell).empty() ? "No obstacle is stated in the cell file: look yourself\n"
                                       : "");
}

nlohmann::ordered_json view_json(const Cell& cell, const Viewed& viewed) {
  const ViewFindings found = view_findings(cell, viewed);
  return {{"cell", cell.name},
          {"poses", found.poses},
          {"touching_obstacle", found.touching},
          {"out_of_sight", found.unseen},
          {"outside_workspace", found.outside},
          {"left", viewed.left},
          {"obstacles", obstacles_in_words(cell)}};
}

Result<Extent> view(const ViewArguments& arguments) {
  Outputs outputs;
  outputs.add("--output", arguments.output);
  outputs.add("--json", arguments.json);
  std::vector<NamedFile> inputs = {{"--cell", arguments.cell}};
  if (!arguments.input.empty()) inputs.push_back({"PLAN", arguments.input});
  TRY(outputs.check(inputs));
  const Cell cell = TRY(read_cell(arguments.cell));
  Viewed viewed;
  if (!arguments.input.empty())
    viewed =
        TRY(is_program({arguments.input}, arguments.format) ? viewed_program(cell, arguments)
                                                            : viewed_plan(cell, arguments.input));
  outputs.put("--output", with_pages_beside(view_page(cell, viewed), arguments.output));
  outputs.put("--json", json_text(view_json(cell, viewed)));
  TRY(outputs.write());
  tell(view_text(cell, viewed, arguments), {arguments.output, arguments.json});
  return viewed.left.empty() ? Extent::kAll : Extent::kPart;
}

}  // namespace

void add_view_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<ViewArguments>();
  CLI::App* command = app.add_subcommand(
      "view", "Draw a cell with the poses of a plan or a program, before anything moves");
  command->add_option("--cell", arguments->cell, "Cell file (YAML)")->required();
  command->add_option("input", arguments->input,
                      "Plan (CSV: joints in deg, rails in mm) or robot program; left out: the cell "
                      "alone");
  command->add_option("--format", arguments->format,
                      "Dialect of the program, where its ending does not tell it");
  command
      ->add_option("-o,--output", arguments->output,
                   "Page to write (HTML); opens without a network")
      ->required();
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return view(*arguments); }; });
}

}  // namespace trammel::cli
