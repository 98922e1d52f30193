#include "clients/cam/dialect.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "clients/cam/fanuc/fanuc.h"
#include "clients/cam/inform/inform.h"
#include "clients/cam/krl/krl.h"
#include "clients/cam/rapid/rapid.h"
#include "clients/cam/stated_robot.h"
#include "clients/cam/tables/tables.h"
#include "clients/cam/urscript/urscript.h"
#include "server/base/letters.h"

namespace trammel::cam {

namespace {

struct Entry {
  Dialect dialect;
  const char* name;
  std::vector<std::string> endings;
  Program (*read)(std::vector<SourceFile>, const ReadOptions&);
  const char* motions;
  std::vector<const char*> rows;  ///< the beginnings of its tool and frame names in --frames
};

const std::vector<Entry>& entries() {
  static const std::vector<Entry> kEntries = {
      {Dialect::kRapid,
       "rapid",
       {".mod", ".prg", ".sys", ".modx", ".prgx", ".sysx"},
       read_rapid,
       "MoveJ, MoveL, MoveC or MoveAbsJ in a MODULE",
       {""}},
      {Dialect::kFanuc,
       "fanuc",
       {".ls"},
       read_fanuc,
       "J, L or C to P[...] with its /POS section",
       {"UTOOL[", "UFRAME["}},
      {Dialect::kKrl,
       "krl",
       {".src", ".dat", ".sub"},
       read_krl,
       "PTP, LIN or CIRC, in a DEF, with its .dat file",
       {"TOOL_DATA[", "BASE_DATA["}},
      {Dialect::kInform,
       "inform",
       {".jbi"},
       read_inform,
       "MOVJ, MOVL or MOVC to C00000 under NPOS",
       {"TOOL[", "USER["}},
      {Dialect::kUrScript,
       "urscript",
       {".script"},
       read_urscript,
       "movej, movel, movep or movec",
       {"TCP"}},
      {Dialect::kCamRob,
       "camrob",
       {},
       read_camrob,
       "rows of number;x;y;z;a;b;c, in mm and deg",
       {"CAMROB"}},
      {Dialect::kRoboDk,
       "robodk",
       {},
       read_robodk,
       "rows of name,x,y,z and rx,ry,rz (deg) or qw,qx,qy,qz, or a header that names them",
       {"ROBODK"}},
  };
  return kEntries;
}

}  // namespace

std::optional<Dialect> dialect_called(const std::string& name) {
  for (const Entry& entry : entries()) {
    if (entry.name == name) return entry.dialect;
  }
  return std::nullopt;
}

const char* name_of(Dialect dialect) {
  for (const Entry& entry : entries()) {
    if (entry.dialect == dialect) return entry.name;
  }
  return "";
}

std::optional<Dialect> dialect_of_file(const std::string& path) {
  const std::size_t dot = path.rfind('.');
  if (dot == std::string::npos) return std::nullopt;
  const std::string ending = lower(path.substr(dot));
  for (const Entry& entry : entries()) {
    if (std::find(entry.endings.begin(), entry.endings.end(), ending) != entry.endings.end())
      return entry.dialect;
  }
  return std::nullopt;
}

const char* motions_of(Dialect dialect) {
  for (const Entry& entry : entries()) {
    if (entry.dialect == dialect) return entry.motions;
  }
  return "";
}

bool may_have_row(Dialect dialect, const std::string& name) {
  for (const Entry& entry : entries()) {
    if (entry.dialect != dialect) continue;
    return name == kRobotBase ||
           std::any_of(entry.rows.begin(), entry.rows.end(),
                       [&](const char* beginning) { return name.starts_with(beginning); });
  }
  return false;
}

std::string dialect_names() {
  std::vector<std::string> names;
  for (const Entry& entry : entries()) names.emplace_back(entry.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

Program read_program(Dialect dialect, std::vector<SourceFile> files, const ReadOptions& options) {
  for (const Entry& entry : entries()) {
    if (entry.dialect != dialect) continue;
    Program program = entry.read(std::move(files), options);
    take_stated(options.stated, program);
    stand_in_world(program, options);
    leave_targets_in(program, options.spared);
    leave_halves_of_arcs(program);
    return program;
  }
  return {};
}

}  // namespace trammel::cam
