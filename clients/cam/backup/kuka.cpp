#include <fmt/format.h>

#include "clients/cam/backup/backup.h"
#include "clients/cam/krl/krl.h"
#include "server/base/letters.h"

namespace trammel::cam {

namespace {

/// As a cell file may have it: `Tool 1` becomes `Tool_1`.
std::string plain_name(const std::string& name) {
  std::string plain;
  for (const char c : name) {
    const bool fits = (lower(c) >= 'a' && lower(c) <= 'z') || is_digit(c) || c == '_' || c == '-';
    plain += fits ? c : '_';
  }
  return plain;
}

}  // namespace

Result<ControllerCell> read_kuka_backup(const std::vector<SourceFile>& files) {
  Program as_it_is;
  as_it_is.files = files;
  TRY(check_files(as_it_is));
  if (files.empty()) return refused("neither $machine.dat nor $config.dat is in the backup");
  KukaData data = read_kuka_data(files);
  ControllerCell cell;
  cell.maker = "KUKA";
  cell.unit = "ROBOT";
  cell.robot_type = data.stated.types.empty() ? "no $TRAFONAME" : data.stated.types.front().type;
  if (!data.stated.bases.empty()) cell.X_WB = data.stated.bases.front().X_WB;
  cell.limits = std::move(data.limits);
  cell.notes = std::move(data.notes);
  for (const auto& [number, tool] : data.tools) {
    std::string name = plain_name(tool.name);
    if (cell.tools.contains(name)) name += fmt::format("_{}", number);
    StatedTool stated{*tool.X_FT, tool.load, fmt::format("{} line {}", tool.file, tool.line)};
    if (!tool.load || tool.load->mass <= 0) {
      stated.load.reset();
      cell.notes.push_back(fmt::format("tool {} has no load there: its payload is to be written by hand", name));
    }
    cell.tools.emplace(std::move(name), std::move(stated));
  }
  for (const auto& [number, base] : data.bases) cell.frames.emplace(base.name, base.X_BO);
  cell.notes.emplace_back(
      "whether the robot is one of absolute accuracy is not in these files: write "
      "controller_compensates by hand");
  cell.stated = std::move(data.stated);
  if (cell.tools.empty())
    return refused("no tool is set (TOOL_DATA) in $config.dat, a cell needs one").of("TOOL_DATA");
  return cell;
}

}  // namespace trammel::cam
