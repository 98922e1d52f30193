#include "server/robot/robot_confirmation.h"

#include <sstream>

#include "server/base/hash.h"

namespace trammel {

namespace {

constexpr const char* kKey = "robot_confirmed:";

std::string line_of(const RobotConfirmation& one) {
  return fmt::format(
      "{} {{robot_sha256: {}, poses: {}, position_mm: {:.4f}, orientation_deg: {:.4f}, day: {}}}   "
      "# written by trammel confirm-robot\n",
      kKey, one.robot_sha256, one.poses, one.position_mm, one.orientation_deg, one.day);
}

}  // namespace

Result<std::string> with_confirmation(const Cell& cell,
                                      const std::optional<RobotConfirmation>& confirmation) {
  std::istringstream lines(cell.cell_yaml);
  std::string text;
  for (std::string line; std::getline(lines, line);)
    if (!line.starts_with(kKey)) text += line + "\n";
  if (confirmation) text += line_of(*confirmation);
  if (const Result<Cell> again = parse_cell(text, cell.robot_yaml, cell.name); !again) {
    return refused("no line can be added to the cell file: {}", again.error().message)
        .of("robot_confirmed")
        .next("write its keys one a line, without braces around the whole");
  }
  return text;
}

}  // namespace trammel
