#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/shown_pose_file.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/hash.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/report/page_parts.h"
#include "server/robot/cell_file.h"
#include "server/robot/robot_confirmation.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

struct ConfirmArguments {
  std::string cell, poses, json;
};

ordered_json comparison_json(const Cell& cell, const RobotComparison& found) {
  return {{"verdict", to_text(found.verdict)},
          {"why", found.why},
          {"cell", cell.name},
          {"robot", cell.robot.name()},
          {"poses", found.poses},
          {"position_rms_mm", to_mm(found.position_rms)},
          {"position_max_mm", to_mm(found.position_max)},
          {"orientation_rms_deg", to_deg(found.rotation_rms)},
          {"orientation_max_deg", to_deg(found.rotation_max)},
          {"limit_mm", to_mm(found.position_limit)},
          {"shown_as", found.shown_as},
          {"angles", found.angles},
          {"could_be", found.could_be}};
}

std::string comparison_text(const RobotComparison& found) {
  std::string text = fmt::format("{}: {}\n", to_text(found.verdict), found.why);
  if (found.verdict == RobotComparison::Verdict::kConfirmed)
    return text + fmt::format("shown: {}; {}\n", found.shown_as, found.angles);
  for (const std::string& one : found.could_be) text += fmt::format("  {}\n", one);
  if (found.verdict == RobotComparison::Verdict::kDiffers)
    text +=
        "Until the file is right, every corrected pose lands off by the difference, since the "
        "controller solves it with its own arm.\n";
  return text;
}

/// Writes the result of the last comparison to the cell file. An invalid comparison does not remove
/// an earlier confirmation, unless it shows that the file is wrong.
Status note_in_cell(const ConfirmArguments& arguments, const Cell& cell,
                    const RobotComparison& found) {
  if (found.verdict == RobotComparison::Verdict::kCannotTell) return {};
  std::optional<RobotConfirmation> confirmation;
  if (found.verdict == RobotComparison::Verdict::kConfirmed) {
    confirmation =
        RobotConfirmation{sha256_hex(cell.robot_yaml), found.poses, to_mm(found.position_max),
                          to_deg(found.rotation_max), shown_day(unix_now())};
  }
  const std::string text = TRY(with_confirmation(cell, confirmation));
  if (text == cell.cell_yaml) return {};
  return write_output(arguments.cell, text);
}

Result<Extent> confirm(const ConfirmArguments& arguments) {
  Outputs outputs;
  outputs.add("--json", arguments.json);
  TRY(outputs.check({{"--cell", arguments.cell}, {"--poses", arguments.poses}}));
  const Cell cell = TRY(read_cell(arguments.cell));
  const ShownPoses shown = TRY(read_shown_poses(arguments.poses, cell.robot));
  const RobotComparison found = TRY(compare_robot(cell, shown).map_error([&](Error error) {
    return Failure(std::move(error)).in(arguments.poses).value();
  }));
  TRY(note_in_cell(arguments, cell, found));
  tell(comparison_text(found), {arguments.json});
  TRY(write_json(arguments.json, comparison_json(cell, found)));
  return found.verdict == RobotComparison::Verdict::kConfirmed ? Extent::kAll : Extent::kPart;
}

}  // namespace

void add_confirm_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<ConfirmArguments>();
  CLI::App* command = app.add_subcommand("confirm-robot",
                                         "Compare the robot file with poses that the controller "
                                         "shows, and note in the cell file that it was");
  command
      ->add_option("--cell", arguments->cell,
                   "Cell file; a line `robot_confirmed` is written into it")
      ->required();
  command
      ->add_option("--poses", arguments->poses,
                   "Some six poses of the flange (tool 0) in the robot's base, as the controller "
                   "shows them: joints, mm, its own angles (CSV)")
      ->required();
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return confirm(*arguments); }; });
}

}  // namespace trammel::cli
