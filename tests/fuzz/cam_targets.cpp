// Robot programs: one target a dialect, and the system parameters of a backup. Several files of one
// program are joined by the byte 0x1E.
#include <filesystem>
#include <set>

#include "clients/cam/backup/backup.h"
#include "clients/cam/correct_program.h"
#include "clients/cam/dialect.h"
#include "server/base/check.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "tests/fuzz/target.h"

namespace trammel::fuzz {
namespace {

namespace fs = std::filesystem;
using cam::Dialect;

constexpr char kNextFile = '\x1e';

const Chain& robot() {
  static const Chain one =
      parse_robot(read_text_file(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml").value(),
                  "robot")
          .value();
  return one;
}

const cam::CellTools& tools() {
  static const cam::CellTools all{
      {{"spindle", make_pose(Eigen::Quaterniond(0.923879532511287, 0, -0.382683432365090, 0)
                                 .normalized()
                                 .toRotationMatrix(),
                             {.1, 0, .15})}},
      {{"spindle", {100, {0, 0, .1}}}}};
  return all;
}

/// Moves every target a little, as a model would.
Result<exchange::Answer<exchange::CorrectedTarget>> moved(
    const std::string&, const std::string&, const std::vector<exchange::AskedTarget>& targets) {
  exchange::Answer<exchange::CorrectedTarget> answer;
  answer.model.id = "0123456789ab";
  for (const exchange::AskedTarget& target : targets) {
    exchange::CorrectedTarget item;
    item.status = target.seed_rad.empty() ? "unreachable" : "ok";
    item.commanded = target.pose;
    item.commanded.xyz_mm[0] += 0.1234567;
    for (const double q : target.seed_rad) item.joints_deg.push_back(to_deg(q));
    item.sigma_mm = 0.01;
    answer.items.push_back(item);
  }
  return answer;
}

std::vector<cam::SourceFile> files_of(std::string_view bytes,
                                      const std::vector<std::string>& names) {
  std::vector<cam::SourceFile> files;
  for (const std::string& name : names) {
    const std::size_t end = std::min(bytes.find(kNextFile), bytes.size());
    files.push_back({name, std::string(bytes.substr(0, end))});
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
    if (bytes.empty()) break;
  }
  return files;
}

bool is_of_number(char c) {
  return (c >= '0' && c <= '9') || c == '.' || c == '-' || c == '+' || c == 'e' || c == 'E';
}

/// A text without the characters that numbers are written with, and without what was inserted or
/// folded.
std::string skeleton(const std::string& text, const std::set<int>& without) {
  std::string kept;
  int line = 1;
  for (const char c : text) {
    if (!without.contains(line) && !is_of_number(c)) kept += c;
    if (c == '\n') ++line;
  }
  return kept;
}

/// No byte is changed but those of numbers, of lines that the receipt lists, and of motions that it
/// says are folded.
void check_bytes(const std::vector<cam::SourceFile>& before, const cam::CorrectedProgram& after) {
  for (const cam::ReceiptRow& row : after.rows) {
    if (row.folded && row.corrected()) return;
  }
  for (std::size_t f = 0; f < before.size(); ++f) {
    if (!after.changed[f]) {
      TRAMMEL_CHECK(after.files[f].text == before[f].text);
      continue;
    }
    std::set<int> inserted;
    for (const cam::InsertedLine& line : after.inserted) {
      if (line.file == before[f].name) inserted.insert(line.line);
    }
    TRAMMEL_CHECK(skeleton(after.files[f].text, inserted) == skeleton(before[f].text, {}));
  }
}

std::string correct(Dialect dialect, const std::vector<cam::SourceFile>& files) {
  cam::ReadOptions reading;
  reading.frames = {{"UTOOL[1]", tools().tools.at("spindle")},
                    {"TOOL[1]", tools().tools.at("spindle")},
                    {"UFRAME[1]", Pose::Identity()},
                    {"USER[1]", Pose::Identity()}};
  const cam::Program program = cam::read_program(dialect, files, reading);
  TRAMMEL_CHECK(program.files.size() == files.size() && program.mark_places.size() == files.size());
  for (std::size_t f = 0; f < files.size(); ++f)
    TRAMMEL_CHECK(program.files[f].text == files[f].text);
  cam::CorrectProgramOptions options;
  options.version = "1";
  options.date = "2026-11-22";
  const auto done = cam::correct_program(program, robot(), tools(), moved, options);
  if (!done) return words_of(done.error());
  check_bytes(files, *done);
  reading.split = true;
  static_cast<void>(cam::read_program(dialect, done->files, reading));
  std::string said = fmt::format("{} corrected", done->moves_corrected > 0 ? "some" : "none");
  for (const cam::ReceiptRow& row : done->rows) {
    if (!row.corrected() && said.size() < 100)
      said += ", " + words_of(refused("{}", row.message).value());
  }
  return said;
}

std::string read_rapid(std::string_view bytes) {
  return correct(Dialect::kRapid, files_of(bytes, {"a.mod", "b.sys"}));
}
std::string read_krl(std::string_view bytes) {
  return correct(Dialect::kKrl, files_of(bytes, {"a.src", "a.dat", "$config.dat"}));
}
std::string read_fanuc(std::string_view bytes) {
  return correct(Dialect::kFanuc, files_of(bytes, {"a.ls"}));
}
std::string read_inform(std::string_view bytes) {
  return correct(Dialect::kInform, files_of(bytes, {"a.jbi"}));
}
std::string read_urscript(std::string_view bytes) {
  return correct(Dialect::kUrScript, files_of(bytes, {"a.script"}));
}
std::string read_camrob(std::string_view bytes) {
  return correct(Dialect::kCamRob, files_of(bytes, {"a.csv"}));
}
std::string read_robodk(std::string_view bytes) {
  return correct(Dialect::kRoboDk, files_of(bytes, {"a.csv"}));
}

std::string read_parameters(std::string_view bytes) {
  const auto cell = cam::read_backup(std::string(bytes), "MOC.cfg", {}, "");
  if (!cell) return words_of(cell.error());
  return fmt::format("taken, {} limits, {} notes", cell->limits.size(), cell->notes.size());
}

/// The programs that tests correct.
std::vector<std::string> programs(const char* kind) {
  std::vector<std::string> all;
  for (const auto& folder :
       fs::directory_iterator(TRAMMEL_SOURCE_DIR "/tests/clients/programs/" + std::string(kind))) {
    std::set<fs::path> files{fs::directory_iterator(folder.path()), fs::directory_iterator()};
    std::string joined, last;
    // $config.dat comes last, .src before .dat.
    for (const char* ending :
         {".mod", ".prg", ".sys", ".src", ".dat", ".ls", ".jbi", ".script", ".csv"}) {
      for (const fs::path& file : files) {
        if (file.extension() != ending) continue;
        const std::string text = read_text_file(file.string()).value();
        if (file.filename() == "$config.dat")
          last = text;
        else
          joined += (joined.empty() ? "" : std::string(1, kNextFile)) + text;
      }
    }
    all.push_back(last.empty() ? joined : joined + kNextFile + last);
  }
  std::sort(all.begin(), all.end());
  return all;
}

std::vector<std::string> rapid_programs() { return programs("rapid"); }
std::vector<std::string> krl_programs() { return programs("krl"); }
std::vector<std::string> fanuc_programs() { return programs("fanuc"); }
std::vector<std::string> inform_programs() { return programs("inform"); }
std::vector<std::string> urscript_programs() { return programs("urscript"); }
std::vector<std::string> camrob_programs() { return programs("camrob"); }
std::vector<std::string> robodk_programs() { return programs("robodk"); }
std::vector<std::string> shipped_parameters() {
  return {read_text_file(TRAMMEL_SOURCE_DIR "/config/programs/backup/SYSPAR/MOC.cfg").value()};
}

}  // namespace

const std::vector<Target>& targets() {
  static const std::vector<Target> all = {
      {"cam_rapid", read_rapid, mutate_text, rapid_programs},
      {"cam_krl", read_krl, mutate_text, krl_programs},
      {"cam_fanuc", read_fanuc, mutate_text, fanuc_programs},
      {"cam_inform", read_inform, mutate_text, inform_programs},
      {"cam_urscript", read_urscript, mutate_text, urscript_programs},
      {"cam_camrob", read_camrob, mutate_table, camrob_programs},
      {"cam_robodk", read_robodk, mutate_table, robodk_programs},
      {"cam_parameters", read_parameters, mutate_text, shipped_parameters},
  };
  return all;
}

}  // namespace trammel::fuzz
