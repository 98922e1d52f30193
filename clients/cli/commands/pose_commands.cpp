#include <CLI/CLI.hpp>
#include <filesystem>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/batch_files.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/units.h"
#include "server/measurement/files/joint_list.h"
#include "server/simulate/simulate.h"

namespace trammel::cli {

namespace {

struct SimulateArguments {
  std::string robot, cell, truth, plan, tool, payload, output, json;
  std::uint64_t seed = 1;
  bool positions_only = false;
  bool noise_free = false;
};

/// The cell, or a bare robot: its base at the world's origin, its flange the tool.
Result<Cell> cell_to_simulate(const SimulateArguments& arguments) {
  if (!arguments.cell.empty()) return read_cell(arguments.cell);
  return read_robot(arguments.robot).map([&](Chain robot) {
    Cell cell;
    cell.name = std::filesystem::path(arguments.robot).stem().string();
    cell.robot = std::move(robot);
    cell.X_WB = Pose::Identity();
    cell.tools["flange"] = Pose::Identity();
    return cell;
  });
}

Status simulate_batch(const SimulateArguments& arguments) {
  Cell read = TRY(cell_to_simulate(arguments));
  const auto cell = std::make_shared<const Cell>(std::move(read));
  const VirtualRobot robot = TRY(read_virtual_robot(arguments.truth, cell));
  JointList list = TRY(read_joint_file(arguments.plan));
  std::vector<PoseContext> poses;
  for (const CommandedPose& pose : list.poses) poses.push_back(pose.context);
  SimulateOptions options;
  options.seed = arguments.seed;
  options.orientation = !arguments.positions_only;
  options.noise = !arguments.noise_free;
  options.tool = arguments.tool;
  options.payload = arguments.payload;
  MeasurementBatch batch = TRY(simulate(robot, poses, options));
  batch.joint_types = list.joint_types;
  for (std::size_t i = 0; i < poses.size(); ++i)
    batch.measurements[i].pose_id = list.poses[i].pose_id;
  TRY(write_output(arguments.output, to_csv(batch)));
  tell(fmt::format("{} measurements in {}\n", batch.measurements.size(), arguments.output),
       {arguments.output, arguments.json});
  return write_json(arguments.json, {{"cell", cell->name},
                                     {"poses", batch.measurements.size()},
                                     {"sigma_mm", to_mm(robot.sigma)},
                                     {"seed", arguments.seed}});
}

void add_simulate(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<SimulateArguments>();
  CLI::App* command = app.add_subcommand("simulate", "Measure planned poses on a virtual robot");
  CLI::Option_group* what = command->add_option_group("Robot");
  what->add_option("--robot", arguments->robot,
                   "Robot file (YAML); it stands alone, and its flange is the tool");
  what->add_option("--cell", arguments->cell, "Cell file (YAML)");
  what->require_option(1);
  command
      ->add_option("--truth", arguments->truth,
                   "Truth file (YAML): what is really wrong with the virtual robot")
      ->required();
  command
      ->add_option("--plan", arguments->plan, "Poses to measure (CSV: joints in deg, rails in mm)")
      ->required();
  add_seed_option(*command, arguments->seed, "Seed of the measuring noise");
  command->add_flag("--positions-only", arguments->positions_only,
                    "Leave out orientations, as a single reflector does");
  command->add_flag("--noise-free", arguments->noise_free,
                    "Write where the tool really is, without measuring noise");
  add_tool_options(*command, arguments->tool, arguments->payload);
  command
      ->add_option("-o,--output", arguments->output,
                   "Batch to write (CSV: joints in deg, rails in mm; positions in mm)")
      ->required();
  add_json_option(*command, arguments->json);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return simulate_batch(*arguments); }; });
}

}  // namespace

void add_pose_commands(CLI::App& app, Action& chosen) { add_simulate(app, chosen); }

}  // namespace trammel::cli
