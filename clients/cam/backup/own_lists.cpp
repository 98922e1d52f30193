#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

#include "clients/cam/backup/backup.h"
#include "clients/cam/cell_tools.h"
#include "clients/cam/fanuc/fanuc.h"
#include "clients/cam/inform/inform.h"
#include "clients/cam/krl/krl.h"
#include "clients/cam/scan.h"
#include "server/base/letters.h"

namespace trammel::cam {

namespace {

/// A name that a cell file allows: `Tool 1` becomes `Tool_1`.
std::string plain_name(const std::string& name) {
  std::string plain;
  for (const char c : name) {
    const bool fits = (lower(c) >= 'a' && lower(c) <= 'z') || is_digit(c) || c == '_' || c == '-';
    plain += fits ? c : '_';
  }
  return plain;
}

/// A name that a program has, `UTOOL[1]` as it stands.
std::string yaml_key(const std::string& name) {
  const std::size_t bracket = name.find('[');
  const bool numbered = bracket != std::string::npos && name.back() == ']' &&
                        name.find_first_not_of("0123456789", bracket + 1) == name.size() - 1;
  return numbered ? plain_name(name.substr(0, bracket)) + name.substr(bracket) : plain_name(name);
}

void add_tool(const std::string& name, StatedTool tool, ControllerCell& cell) {
  if (tool.load && tool.load->mass <= 0) tool.load.reset();
  cell.tools.emplace(name, std::move(tool));
}

/// `TOOL[1], TOOL[2], TOOL[3] and 28 more`
std::string some_of(const std::vector<std::string>& names) {
  constexpr std::size_t kNamed = 3;
  const auto named = static_cast<std::ptrdiff_t>(std::min(names.size(), kNamed));
  const std::string more =
      names.size() > kNamed ? fmt::format(" and {} more", names.size() - kNamed) : "";
  return fmt::format("{}{}", fmt::join(names.begin(), names.begin() + named, ", "), more);
}

/// One sentence for all tools without a load, however many lists have.
void note_loads(ControllerCell& cell) {
  std::vector<std::string> without;
  for (const auto& [name, tool] : cell.tools)
    if (!tool.load) without.push_back(name);
  if (without.size() == 1)
    cell.notes.push_back(
        fmt::format("tool {} has no load there: its payload is to be written by hand", without[0]));
  if (without.size() > 1)
    cell.notes.push_back(
        fmt::format("{} tools have no load there ({}): their payloads are to be written by hand",
                    without.size(), some_of(without)));
}

ControllerCell kuka_cell(const std::vector<SourceFile>& files) {
  KukaData data = read_kuka_data(files);
  ControllerCell cell;
  cell.maker = "KUKA";
  cell.robot_type = data.stated.types.empty() ? "no $TRAFONAME" : data.stated.types.front().type;
  if (!data.stated.bases.empty()) cell.X_WB = data.stated.bases.front().X_WB;
  cell.limits = std::move(data.limits);
  cell.arm = std::move(data.arm);
  cell.why_no_arm = std::move(data.why_no_arm);
  cell.notes = std::move(data.notes);
  for (const auto& [number, tool] : data.tools) {
    const std::string name = plain_name(tool.name);
    add_tool(cell.tools.contains(name) ? fmt::format("{}_{}", name, number) : name,
             {*tool.X_FT, tool.load, fmt::format("{} line {}", tool.file, tool.line), number},
             cell);
  }
  for (const auto& [number, base] : data.bases) cell.frames.emplace(base.name, base.X_BO);
  cell.stated = std::move(data.stated);
  return cell;
}

/// `$SCR_GRP[1].$ROBOT_ID  Access: RW: STRING[37] = 'M-20iA'`; in SUMMARY.DG and VERSION.DG the
/// line above that of the servo code, without its version: `M-20iA  V9.30P/15`.
std::string fanuc_type(std::string_view line, std::string_view before) {
  constexpr std::string_view kNamed = "$SCR_GRP[1].$ROBOT_ID", kBelow = "Servo Code";
  if (line.find(kNamed) != std::string_view::npos) {
    const std::size_t end = line.rfind('\''), begin = line.find('\'');
    return begin < end && end != std::string_view::npos
               ? std::string(trimmed(line.substr(begin + 1, end - begin - 1)))
               : "";
  }
  if (!line.starts_with(kBelow)) return "";
  const std::string_view name = before.substr(0, before.find("  "));
  return std::string(trimmed(name));
}

/// Below `//ROBOT NAME`: `R1 : 1-06VX25-A0*(GP25)  0011_1111`.
std::string yaskawa_type(std::string_view line, std::string_view before) {
  const std::size_t begin = line.find('('), end = line.find(')');
  const bool names_it =
      before.starts_with("//ROBOT NAME") && begin < end && end != std::string_view::npos;
  return names_it ? std::string(trimmed(line.substr(begin + 1, end - begin - 1))) : "";
}

/// The type of the robot as one of the files says it.
StatedRobot stated_type(Dialect dialect, const std::vector<SourceFile>& files) {
  StatedRobot stated;
  for (const SourceFile& file : files) {
    std::string_view before;
    for (const TextLine& line : text_lines(file.text)) {
      const std::string type = dialect == Dialect::kFanuc ? fanuc_type(line.text, before)
                                                          : yaskawa_type(line.text, before);
      if (!type.empty() && stated.types.empty())
        stated.types.push_back({type, "the robot's type", file.name, line.number});
      before = line.text;
    }
  }
  return stated;
}

/// Tools and frames are called as programs call them: `UTOOL[1]`, `USER[2]`.
ControllerCell listed_cell(const ListedValues& lists, const char* maker, StatedRobot stated) {
  ControllerCell cell;
  cell.maker = maker;
  cell.robot_type = stated.types.empty() ? "no list names it" : stated.types.front().type;
  cell.stated = std::move(stated);
  for (const auto& [name, value] : lists.all()) {
    const bool is_tool = name.find("TOOL[") != std::string::npos;
    const bool is_set =
        (value.load && value.load->mass > 0) || !same_place(value.X, Pose::Identity());
    if (!value.why_not.empty())
      cell.notes.push_back(fmt::format("{} is left out: {}", name, value.why_not));
    else if (is_tool && is_set)
      add_tool(name, {value.X, value.load, fmt::format("{} line {}", value.file, value.line)},
               cell);
    else if (!is_tool)
      cell.frames.emplace(name, value.X);
  }
  cell.notes.emplace_back(
      "where the robot stands and its limits are not in these lists: the base is taken as the "
      "controller's world");
  return cell;
}

}  // namespace

std::set<std::string> own_lists_of(Dialect dialect) {
  if (dialect == Dialect::kKrl) return {"$machine.dat", "$config.dat"};
  if (dialect == Dialect::kFanuc) return {"sysframe.va", "framevar.va"};
  if (dialect == Dialect::kInform) return {"tool.cnd", "uframe.cnd"};
  return {};
}

ControllerCell cell_of_program(const Program& program) {
  ControllerCell cell;
  cell.maker = program.dialect;
  cell.unit = "ROBOT";
  cell.robot_type = program.types.empty() ? "no file names it" : program.types.front().type;
  cell.stated = program;
  if (!program.bases.empty()) cell.X_WB = program.bases.front().X_WB;
  for (const ProgramTool& tool : program.tools) {
    const bool told = tool.X_FT && tool.why_not.empty() && !tool.name.empty();
    const bool is_set = told && (tool.load || !same_place(*tool.X_FT, Pose::Identity()));
    if (!is_set || cell.tools.contains(tool.name)) continue;
    StatedTool stated{*tool.X_FT, tool.load, fmt::format("{} line {}", tool.file, tool.line)};
    if (stated.load && is_placeholder(*stated.load)) stated.load.reset();
    add_tool(yaml_key(tool.name), std::move(stated), cell);
  }
  note_loads(cell);
  for (const ProgramFrame& frame : program.frames)
    if (frame.why_not.empty() && !frame.name.empty()) cell.frames.emplace(frame.name, frame.X_BO);
  return cell;
}

std::set<std::string> type_files_of(Dialect dialect) {
  if (dialect == Dialect::kFanuc) return {"sysvars.va", "system.va", "summary.dg", "version.dg"};
  if (dialect == Dialect::kInform) return {"system.sys"};
  return {};
}

Result<ControllerCell> read_own_lists(Dialect dialect, const std::vector<SourceFile>& files) {
  Program as_it_is;
  as_it_is.files = files;
  TRY(check_files(as_it_is));
  ControllerCell cell;
  if (dialect == Dialect::kKrl && !files.empty()) cell = kuka_cell(files);
  if (dialect == Dialect::kFanuc)
    cell = listed_cell(fanuc::system_frames(files), "FANUC", stated_type(dialect, files));
  if (dialect == Dialect::kInform)
    cell = listed_cell(inform::conditions(files), "Yaskawa", stated_type(dialect, files));
  cell.unit = "ROBOT";
  note_loads(cell);
  cell.notes.emplace_back(
      "whether the controller corrects the robot itself is not in these files: write "
      "controller_compensates by hand");
  if (cell.tools.empty())
    return refused("no tool in the controller's own lists, a cell needs one")
        .of("tooldata")
        .next("$config.dat, SYSFRAME.VA or TOOL.CND has it");
  return cell;
}

}  // namespace trammel::cam
