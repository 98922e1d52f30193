// Every line of every document that somebody may type is typed here, or a reason is given why not.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/daemon.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes kLimit{3};

/// Lines of code that stand together: fenced, or indented by four blanks below an empty line.
struct Block {
  std::string document, language;
  std::vector<std::string> lines;
};

std::vector<Block> blocks_of(const std::string& document) {
  std::istringstream in(test::read_file(TRAMMEL_SOURCE_DIR "/" + document));
  std::vector<Block> blocks;
  bool fenced = false, indented = false, after_empty = true;
  for (std::string line; std::getline(in, line);) {
    const bool fence = line.starts_with("```");
    if (fence && !fenced) blocks.push_back({document, line.substr(3), {}});
    if (fence) fenced = !fenced;
    const bool code = !fenced && !fence && line.starts_with("    ") && (indented || after_empty);
    if (code && !indented) blocks.push_back({document, "", {}});
    if (code || (fenced && !fence)) blocks.back().lines.push_back(code ? line.substr(4) : line);
    indented = code;
    after_empty = line.empty();
  }
  return blocks;
}

std::vector<std::string> documents() {
  std::vector<std::string> all;
  const test::Finished listed =
      test::run({"/usr/bin/env", "git", "-C", TRAMMEL_SOURCE_DIR, "ls-files", "*.md"});
  std::istringstream in(listed.out);
  for (std::string line; std::getline(in, line);) all.push_back(line);
  return all;
}

/// True if the line is one for a shell: no other language, table, formula or drawing.
bool is_command(const std::string& line) {
  static constexpr std::array<std::string_view, 12> kPrograms = {
      "trammel ", "trammeld ", "deploy/",  "cmake ", "apt ",       "promtool ",
      "tests/",   "export ",   "python3 ", "kill ",  "systemctl ", "ctest "};
  return std::any_of(kPrograms.begin(), kPrograms.end(),
                     [&](std::string_view one) { return line.starts_with(one); });
}

/// Lines that are not typed here, by their beginnings, and why.
const std::map<std::string, std::string>& not_typed() {
  static const std::map<std::string, std::string> kReasons = {
      {"deploy/supervise trammeld",
       "runs until it is stopped; the daemon of this test stands for it"},
      {"trammel cpa ", "MeasurementCommands"},
      {"trammel deflection ", "MeasurementCommands"},
      {"apt install", "deploy/try-packages"},
      {"cmake --build --preset release --target packages", "Debian.*"},
      {"promtool", "needs Prometheus"},
      {"tests/benchmarks/figures", "takes minutes; Figures.*"},
      {"tests/fuzz/run", "takes minutes; Fuzz.*"},
      {"deploy/check fuzz", "takes minutes; Fuzz.*"},
      {"export P", "belongs to the lines below it"},
      {"python3 /usr/share/doc/python3-trammel/tour.py", "Python.*, deploy/try-packages"},
      {"deploy/http/correct", "needs a service with `api: true`; GatewayTest.TheExamples..."},
      {"trammel status --host line-3.works", "needs another host; Security.*"},
      {"trammel doctor --host line-3.works", "needs another host; Security.*"},
      {"trammeld --config server.yaml --check", "needs another host's address; Security.*"},
  };
  return kReasons;
}

/// Documents whose blocks other tests run.
bool is_run_elsewhere(const std::string& document) {
  return document == "README.md" || document.ends_with("TOUR.md");  // Readme.*, Tour.*
}

bool is_left_out(const std::string& line) {
  return std::any_of(not_typed().begin(), not_typed().end(),
                     [&](const auto& one) { return line.starts_with(one.first); });
}

/// The files that the lines of config/OPERATIONS.md find in the folder where they are typed.
constexpr const char* kFiles = R"(
set -euo pipefail
cell=config/cell-7.yaml
measured() { trammel simulate --cell "$1" --truth models/truth/chapter-5.yaml --plan "$2" --seed "$3" -o "$4"; }
cp config/drill-panel.csv targets.csv
cp config/programs/drill.mod .
ln -s config/programs/backup BACKUP
trammel plan --cell $cell --count 30 --criterion separate:payload,compliance -o plan.csv
measured $cell plan.csv 1 sa.csv
# Points as SpatialAnalyzer exports them, named by the plan's poses.
awk -F, '/^#/ {next} !n {for (i = 1; i <= NF; ++i) at[$i] = i; n = 1; next}
  {printf "Collection, Group, %s, %s, %s, %s\n", $at["pose_id"], $at["x_mm"], $at["y_mm"], $at["z_mm"]}' sa.csv > sa-export.txt
trammel plan --cell $cell --count 40 --seed 2 -o fresh-plan.csv
measured $cell fresh-plan.csv 2 fresh.csv
trammel plan --cell $cell --check 12 -o few-plan.csv
measured $cell few-plan.csv 3 few.csv
cp few-plan.csv next.csv
grep -v '^#' fresh-plan.csv | cut -d, -f1-7 > bare.csv
for b in 1 2; do
  trammel plan --cell $cell --count 60 --seed 1$b -o b$b-plan.csv
  measured $cell b$b-plan.csv 1$b b$b.csv
done
printf 'name,x_mm,y_mm,z_mm\nR1,0,0,0\nR2,3000,0,0\nR3,0,2000,0\nR4,0,0,1500\n' > refs.csv
printf 'name,x_mm,y_mm,z_mm\nR1,0.01,0,0\nR2,3000.01,0,0\nR3,0.01,2000,0\nR4,0.01,0,1500\n' > now.csv
for name in a b c cell-8; do
  sed "s/^cell: .*/cell: $name/; s|\.\./models|models|" $cell > $name.yaml
  trammel plan --cell $name.yaml --count 60 --seed 4 -o p.csv
  measured $name.yaml p.csv 5 b.csv
  [ $name = cell-8 ] || trammel train --cell $name.yaml --batch b.csv -o $name.model
done
sed 's|\.\./models|models|; s/^  spindle: {xyz_mm: .*q_wxyz.*/  spindle: null/' $cell > new-tool.yaml
awk -F, '/^#/ || !n++ {next} {print n, $2 / 57.29578, $3 / 57.29578, $4 / 57.29578, $5 / 57.29578, $6 / 57.29578,
  $7 / 57.29578, $8 / 1000, $9 / 1000, $10 / 1000}' OFS=, fresh.csv > log.txt
)";

/// A copy of what ships, with everything that documents name, and a daemon once one is asked for.
class Desk {
 public:
  Desk() {
    for (const char* shipped : {"config", "models", "deploy"})
      fs::copy(fs::path(TRAMMEL_SOURCE_DIR) / shipped, folder_.path() / shipped,
               fs::copy_options::recursive);
    const test::Finished made = typed(kFiles);
    EXPECT_EQ(made.exit_code, 0) << made.out << made.err;
  }

  test::Finished typed(const std::string& line) const {
    const std::string script =
        "cd '" + folder_.path().string() + "'\nexport TRAMMEL_DEFAULTS='" + defaults_ +
        "' PATH=" TRAMMEL_BINARY_DIR "/clients:" TRAMMEL_BINARY_DIR "/server:$PATH\n" + line;
    return test::run({"/bin/bash", "-c", script}, kLimit);
  }

  /// From here on `--service` finds a daemon, which has learned from two batches.
  void start_daemon() {
    daemon_.emplace();
    daemon_->start();
    defaults_ =
        folder_.write("defaults", "port = " + std::to_string(daemon_->port()) +
                                      "\ndomain = " + std::to_string(daemon_->domain()) + "\n");
    fs::create_symlink(daemon_->store_path(), folder_.path() / "config/trammel.db");
    for (const std::string batch : {"b1", "b2"}) {
      const test::Finished sent =
          typed("trammel submit --service --cell cell-7 --batch " + batch + ".csv --watch");
      EXPECT_LE(sent.exit_code.value_or(9), 1) << sent.err;
    }
  }

 private:
  test::TemporaryFolder folder_;
  std::string defaults_;
  std::optional<test::Daemon> daemon_;
};

/// Types the lines of a document in their order; how many there were.
int type_lines(const std::string& document, Desk& desk) {
  int typed = 0;
  for (const Block& block : blocks_of(document)) {
    for (const std::string& line : block.lines) {
      if (line.starts_with("deploy/supervise trammeld")) desk.start_daemon();
      if (!is_command(line) || is_left_out(line)) continue;
      ++typed;
      const test::Finished done = desk.typed(line);
      EXPECT_LE(done.exit_code.value_or(9), 1) << document << ": " << line << "\n"
                                               << done.out << done.err;
    }
  }
  return typed;
}

TEST(Documents, WhatTheCellEngineerIsToTypeEveryDayRuns) {
  Desk desk;
  EXPECT_GE(type_lines("config/OPERATIONS.md", desk), 30);
}

TEST(Documents, WhatEveryOtherDocumentHasSomebodyTypeRuns) {
  Desk desk;
  int typed = 0;
  for (const std::string& document : documents()) {
    if (!is_run_elsewhere(document) && document != "config/OPERATIONS.md")
      typed += type_lines(document, desk);
  }
  EXPECT_GE(typed, 7);
}

TEST(Documents, EveryReasonNotToTypeALineIsNeeded) {
  for (const auto& reason : not_typed()) {
    const std::string beginning(reason.first);
    int lines = 0;
    for (const std::string& document : documents()) {
      for (const Block& block : blocks_of(document))
        lines += std::any_of(block.lines.begin(), block.lines.end(),
                             [&](const std::string& line) { return line.starts_with(beginning); })
                     ? 1
                     : 0;
    }
    EXPECT_GT(lines, 0) << beginning << " stands in no document any more";
  }
}

std::string text_of(const Block& block) {
  std::string text;
  for (const std::string& line : block.lines) text += line + "\n";
  return text;
}

/// What reads config/shown.yaml as what it is: a cell, a robot, a part of a cell, or the truth of a
/// virtual robot.
std::string reader_of(const std::string& yaml) {
  const auto has = [&](const char* key) { return yaml.find(key) != std::string::npos; };
  const std::string plan = "trammel plan --count 5 -o shown.csv --cell config/";
  if (has("cell:")) return plan + "shown.yaml";
  if (has("joints:"))
    return "sed 's|^robot: .*|robot: shown.yaml|; /^joint_ranges_deg/d' config/cell-7.yaml > "
           "config/c.yaml; " +
           plan + "c.yaml";
  if (has("anchors:"))
    return "cat config/cell-7.yaml config/shown.yaml > config/c.yaml; " + plan + "c.yaml";
  return "sed 's/^  spindle: {xyz_mm: .*q_wxyz.*/  probe: null/; s/^base: .*/base: null/' "
         "config/cell-7.yaml > config/c.yaml; trammel simulate --cell config/c.yaml --truth "
         "config/shown.yaml --plan bare.csv -o shown.csv";
}

TEST(Documents, TheYamlFilesThatTheyShowAreRead) {
  Desk desk;
  int read = 0;
  for (const std::string& document : documents()) {
    for (const Block& block : blocks_of(document)) {
      if (block.language != "yaml") continue;
      ++read;
      const std::string text = text_of(block);
      const test::Finished done =
          desk.typed("cat > config/shown.yaml <<'END'\n" + text + "END\n" + reader_of(text));
      EXPECT_EQ(done.exit_code, 0) << document << "\n" << text << done.out << done.err;
    }
  }
  EXPECT_GE(read, 4);
}

}  // namespace
}  // namespace trammel
