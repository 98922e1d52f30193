#include <CLI/CLI.hpp>
#include <filesystem>

#include "clients/cli/commands.h"
#include "clients/cli/options.h"
#include "clients/cli/output.h"
#include "server/base/units.h"
#include "server/measurement/joint_list.h"
#include "server/measurement/pose_columns.h"
#include "server/plan/plan.h"
#include "server/simulate/simulate.h"

namespace trammel::cli {

namespace {

struct PlanArguments {
  std::string cell, criterion = "lhs", output, json;
  int count = 0;
  std::uint64_t seed = 1;
};

Status plan(const PlanArguments& arguments) {
  const Result<Cell> cell = read_cell(arguments.cell);
  if (!cell) return tl::make_unexpected(cell.error());
  const Result<Eigen::MatrixXd> q = plan_poses(*cell, {arguments.count, arguments.seed});
  if (!q) return tl::make_unexpected(q.error());
  JointList list{arguments.output, joint_types(cell->robot), {}};
  for (Eigen::Index i = 0; i < q->rows(); ++i) {
    CommandedPose pose;
    pose.pose_id = fmt::format("{}", i + 1);
    pose.context.q = q->row(i).transpose();
    list.poses.push_back(std::move(pose));
  }
  if (const Status written = write_output(arguments.output, to_csv(list)); !written) return written;
  tell(fmt::format("{} poses for cell {} in {}\n", q->rows(), cell->name, arguments.output),
       {arguments.output, arguments.json});
  return write_json(arguments.json, {{"cell", cell->name}, {"poses", q->rows()}, {"seed", arguments.seed}});
}

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

/// Fills in --tool and --payload where the plan names none, and takes both from the plan: they are one for all poses.
Status use_one_tool(JointList& list, SimulateArguments& arguments, const Cell& cell) {
  for (CommandedPose& pose : list.poses) {
    if (pose.context.tool.empty()) pose.context.tool = arguments.tool;
    if (pose.context.payload.empty()) pose.context.payload = arguments.payload;
  }
  Result<JointList> checked = check_against_cell(std::move(list), cell);
  if (!checked) return tl::make_unexpected(checked.error());
  list = std::move(*checked);
  const PoseContext& first = list.poses.front().context;
  for (const CommandedPose& pose : list.poses) {
    if (pose.context.tool == first.tool && pose.context.payload == first.payload) continue;
    return refused("{} row {}: tool '{}' and payload '{}' after '{}' and '{}'; a simulated batch has one of each",
                   list.where, pose.row, pose.context.tool, pose.context.payload, first.tool, first.payload);
  }
  arguments.tool = first.tool;
  arguments.payload = first.payload;
  return {};
}

Status simulate_batch(SimulateArguments arguments) {
  Result<Cell> read = cell_to_simulate(arguments);
  if (!read) return tl::make_unexpected(read.error());
  const auto cell = std::make_shared<const Cell>(std::move(*read));
  const Result<VirtualRobot> robot = read_virtual_robot(arguments.truth, cell);
  if (!robot) return tl::make_unexpected(robot.error());
  Result<JointList> list = read_joint_csv(arguments.plan);
  if (!list) return tl::make_unexpected(list.error());
  if (const Status one_tool = use_one_tool(*list, arguments, *cell); !one_tool) return one_tool;

  Eigen::MatrixXd q(static_cast<Eigen::Index>(list->poses.size()), cell->robot.size());
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    q.row(i) = list->poses[static_cast<std::size_t>(i)].context.q.transpose();
  }
  SimulateOptions options;
  options.seed = arguments.seed;
  options.orientation = !arguments.positions_only;
  options.noise = !arguments.noise_free;
  options.tool = arguments.tool;
  options.payload = arguments.payload;
  Result<MeasurementBatch> batch = simulate(*robot, q, options);
  if (!batch) return tl::make_unexpected(batch.error());
  batch->joint_types = list->joint_types;
  for (std::size_t i = 0; i < list->poses.size(); ++i) batch->measurements[i].pose_id = list->poses[i].pose_id;
  if (const Status written = write_output(arguments.output, to_csv(*batch)); !written) return written;
  tell(fmt::format("{} measurements in {}\n", batch->measurements.size(), arguments.output),
       {arguments.output, arguments.json});
  return write_json(arguments.json, {{"cell", cell->name},
                                     {"poses", batch->measurements.size()},
                                     {"sigma_mm", to_mm(robot->sigma)},
                                     {"seed", arguments.seed}});
}

void add_plan(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<PlanArguments>();
  CLI::App* command = app.add_subcommand("plan", "Plan measuring poses for a cell");
  command->add_option("--cell", arguments->cell, "Cell file (YAML)")->required();
  command->add_option("--count", arguments->count, "Number of poses")->required()->check(CLI::Range(1, 1000000));
  command->add_option("--seed", arguments->seed, "Seed of the draw")->capture_default_str();
  command->add_option("--criterion", arguments->criterion, "How poses are chosen: lhs, a Latin hypercube")
      ->check(CLI::IsMember({"lhs"}))
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output, "Plan to write (CSV: joints in deg, rails in mm)")->required();
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return plan(*arguments); }; });
}

void add_simulate(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<SimulateArguments>();
  CLI::App* command = app.add_subcommand("simulate", "Measure planned poses on a virtual robot");
  CLI::Option_group* what = command->add_option_group("Robot");
  what->add_option("--robot", arguments->robot, "Robot file (YAML), standing alone with its flange as the tool");
  what->add_option("--cell", arguments->cell, "Cell file (YAML)");
  what->require_option(1);
  command->add_option("--truth", arguments->truth, "Virtual robot's true parameters (YAML)")->required();
  command->add_option("--plan", arguments->plan, "Poses to measure (CSV: joints in deg, rails in mm)")->required();
  command->add_option("--seed", arguments->seed, "Seed of the measuring noise")->capture_default_str();
  command->add_flag("--positions-only", arguments->positions_only,
                    "Leave out orientations, as a single reflector does");
  command->add_flag("--noise-free", arguments->noise_free, "Write where the tool really is, without measuring noise");
  add_tool_options(*command, arguments->tool, arguments->payload);
  command->add_option("-o,--output", arguments->output, "Batch to write (CSV: deg, mm)")->required();
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return simulate_batch(*arguments); }; });
}

}  // namespace

void add_pose_commands(CLI::App& app, Action& chosen) {
  add_plan(app, chosen);
  add_simulate(app, chosen);
}

}  // namespace trammel::cli
