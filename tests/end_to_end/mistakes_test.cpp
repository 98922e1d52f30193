#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_cell.h"

// A walk of mistakes that people make at the command line: each is refused with its kind, says
// where it is as data, and what to do next.
namespace trammel {
namespace {

using nlohmann::json;
using test::Finished;

/// `${CELL}` and the like stand for files that the walk starts with.
struct Mistake {
  const char* name;
  std::vector<std::string> words;
  int exit_code;
  std::string file = {}, field = {};  ///< as the error has them; empty: none
  long row = 0;                       ///< 0: none
  std::string next = {};              ///< part of the next step; empty: any
};

const std::vector<Mistake>& mistakes() {
  static const std::vector<Mistake> all = {
      // Commands and options.
      {"misspelled command",
       {"pln", "--cell", "${CELL}"},
       2,
       "",
       "command",
       0,
       "trammel plan --help"},
      {"no such command", {"frobnicate"}, 2, "", "command", 0, "trammel help"},
      {"option before its command", {"--count", "5"}, 2, "", "--count", 0, "trammel help"},
      {"misspelled option",
       {"plan", "--cel", "${CELL}", "--count", "5", "-o", "p"},
       2,
       "",
       "--cel",
       0,
       "plan --help"},
      {"begun option", {"train", "--cell", "${CELL}", "--bat", "b.csv", "-o", "m"}, 2, "", "--bat"},
      {"option of another command", {"evaluate", "--count", "5"}, 2, "", "--count"},
      {"option left out", {"train", "--cell", "${CELL}", "-o", "m"}, 2, "", "--batch"},
      {"output left out", {"train", "--cell", "${CELL}", "--batch", "${BATCH}"}, 2, "", "--output"},
      {"a word for a number",
       {"plan", "--cell", "${CELL}", "--count", "five", "-o", "p"},
       2,
       "",
       "--count"},
      {"a number out of range",
       {"plan", "--cell", "${CELL}", "--count", "0", "-o", "p"},
       2,
       "",
       "--count"},
      {"a unit behind a number",
       {"correct", "--model", "${MODEL}", "--tolerance", "0.2mm", "${TARGETS}", "-o", "c"},
       2,
       "",
       "--tolerance"},
      {"an option twice",
       {"plan", "--cell", "${CELL}", "--count", "5", "--count", "6", "-o", "p"},
       2,
       "",
       "--count"},
      {"a word too many",
       {"plan", "--cell", "${CELL}", "--count", "5", "-o", "p", "more"},
       2,
       "",
       ""},
      {"a port that is none", {"status", "--port", "abc"}, 2, "", "--port"},
      {"a port out of range", {"status", "--port", "99999"}, 2, "", "--port"},
      {"a domain out of range", {"status", "--domain", "300"}, 2, "", "--domain"},
      {"a host with a port that is none",
       {"status", "--host", "127.0.0.1:99", "--timeout", "0.3"},
       2,
       "",
       "--host",
       0,
       "line-3:17500"},
      {"an unknown criterion",
       {"plan", "--cell", "${CELL}", "--count", "5", "--criterion", "lsh", "-o", "p"},
       2,
       "",
       "--criterion"},
      {"an unknown level",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "--level", "M9", "-o", "m"},
       2,
       "",
       ""},
      {"a misspelled cause",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "--level", "M2,complience", "-o", "m"},
       2,
       "",
       ""},
      {"a kernel of another program",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "--bias", "rbf", "-o", "m"},
       2,
       "",
       ""},
      {"an unknown study", {"study", "3dmi"}, 2, "", ""},
      {"an unknown topic", {"help", "formts"}, 2, "", "topic"},
      {"a version left out", {"activate", "--model", "cell-7"}, 2, "", "--model"},
      // Files.
      {"no such cell file",
       {"train", "--cell", "cell-7.yml", "--batch", "${BATCH}", "-o", "m"},
       3,
       "cell-7.yml",
       "",
       0,
       "cell-7.yaml"},
      {"no such batch",
       {"train", "--cell", "${CELL}", "--batch", "btach.csv", "-o", "m"},
       3,
       "btach.csv",
       "",
       0,
       "batch.csv"},
      {"a folder for a file",
       {"train", "--cell", "${CELL}", "--batch", "folder", "-o", "m"},
       3,
       "folder",
       "",
       0,
       "file"},
      {"into a folder that is not there",
       {"plan", "--cell", "${CELL}", "--count", "5", "-o", "no/such/p.csv"},
       3,
       "no/such/p.csv",
       "",
       0,
       "mkdir"},
      {"onto a folder",
       {"plan", "--cell", "${CELL}", "--count", "5", "-o", "folder"},
       3,
       "folder",
       "",
       0,
       "file"},
      {"cell and batch swapped",
       {"train", "--cell", "${BATCH}", "--batch", "${CELL}", "-o", "m"},
       3,
       "${BATCH}",
       "",
       1,
       "--cell"},
      {"model and batch swapped",
       {"evaluate", "--model", "${BATCH}", "--batch", "${MODEL}"},
       3,
       "${BATCH}",
       "",
       0,
       "--model"},
      {"a robot file for a cell file",
       {"train", "--cell", "${ROBOT}", "--batch", "${BATCH}", "-o", "m"},
       3,
       "${ROBOT}",
       "*",
       -1,
       "robot file"},
      {"a cell file for a truth",
       {"simulate", "--cell", "${CELL}", "--truth", "${CELL}", "--plan", "plan.csv", "-o", "b"},
       3,
       "${CELL}",
       "*",
       -1,
       "cell file"},
      {"a cell for a model without --service",
       {"correct", "--model", "cell-9", "${TARGETS}", "-o", "c"},
       3,
       "cell-9",
       "",
       0,
       "--service"},
      {"an empty file",
       {"train", "--cell", "${CELL}", "--batch", "empty.csv", "-o", "m"},
       3,
       "empty.csv",
       ""},
      {"an empty model",
       {"evaluate", "--model", "empty.csv", "--batch", "${BATCH}"},
       3,
       "empty.csv",
       ""},
      {"a model that was cut off",
       {"evaluate", "--model", "cut.model", "--batch", "${BATCH}"},
       3,
       "cut.model",
       ""},
      {"random bytes",
       {"train", "--cell", "${CELL}", "--batch", "random.csv", "-o", "m"},
       3,
       "random.csv",
       "",
       1},
      {"a spreadsheet",
       {"train", "--cell", "${CELL}", "--batch", "batch.xlsx", "-o", "m"},
       3,
       "batch.xlsx",
       "",
       0,
       "CSV UTF-8"},
      {"a spreadsheet of targets",
       {"correct", "--model", "${MODEL}", "batch.xlsx", "-o", "c"},
       3,
       "batch.xlsx",
       "",
       0,
       "CSV UTF-8"},
      {"text in UTF-16",
       {"train", "--cell", "${CELL}", "--batch", "utf16.csv", "-o", "m"},
       3,
       "utf16.csv",
       "",
       0,
       "CSV UTF-8"},
      {"a program of no known kind",
       {"correct", "--model", "${MODEL}", "plan.xyz", "-o", "c"},
       2,
       "plan.xyz",
       ""},
      {"a page of a table",
       {"correct", "--model", "${MODEL}", "${TARGETS}", "-o", "c", "--report", "r.html"},
       2,
       "${TARGETS}",
       "--report",
       0,
       "formats"},
      {"a table to be corrected again",
       {"correct", "--model", "${MODEL}", "${TARGETS}", "-o", "c", "--again"},
       2,
       "${TARGETS}",
       "--again",
       0,
       "formats"},
      {"a kind of program for joints",
       {"predict", "--model", "${MODEL}", "--joints", "plan.csv", "--format", "rapid", "-o", "p"},
       2,
       "",
       "--format"},
      {"points without joints", {"convert", "--points", "plan.csv", "-o", "b"}, 2, "", "--joints"},
      // Rows and columns.
      {"a comma that does both",
       {"train", "--cell", "${CELL}", "--batch", "commas.csv", "-o", "m"},
       3,
       "commas.csv",
       "",
       2,
       "';'"},
      {"a column left out",
       {"train", "--cell", "${CELL}", "--batch", "no-z.csv", "-o", "m"},
       3,
       "no-z.csv",
       "z_mm"},
      {"a column in metres",
       {"train", "--cell", "${CELL}", "--batch", "metres.csv", "-o", "m"},
       3,
       "metres.csv",
       "x_mm",
       0,
       "x_m"},
      {"a misspelled column",
       {"train", "--cell", "${CELL}", "--batch", "deq.csv", "-o", "m"},
       3,
       "deq.csv",
       "q3_deg",
       0,
       "q3_deq"},
      {"a word in a column",
       {"train", "--cell", "${CELL}", "--batch", "word.csv", "-o", "m"},
       3,
       "word.csv",
       "q2_deg",
       3},
      {"a gap in a column",
       {"train", "--cell", "${CELL}", "--batch", "gap.csv", "-o", "m"},
       3,
       "gap.csv",
       "q2_deg",
       3},
      {"a row cut short",
       {"train", "--cell", "${CELL}", "--batch", "short.csv", "-o", "m"},
       3,
       "short.csv",
       "",
       3},
      {"a pose twice",
       {"train", "--cell", "${CELL}", "--batch", "twice.csv", "-o", "m"},
       3,
       "twice.csv",
       "pose_id",
       3},
      {"a joint beyond its limit",
       {"train", "--cell", "${CELL}", "--batch", "beyond.csv", "-o", "m"},
       3,
       "beyond.csv",
       "q2_deg",
       3},
      {"a tool of another cell",
       {"train", "--cell", "${CELL}", "--batch", "gripper.csv", "-o", "m"},
       3,
       "gripper.csv",
       "*",
       3},
      {"a batch of another robot",
       {"train", "--cell", "${OTHER}", "--batch", "${BATCH}", "-o", "m"},
       3,
       "${BATCH}",
       "*",
       -1},
      {"a misspelled key",
       {"train", "--cell", "misspelled.yaml", "--batch", "${BATCH}", "-o", "m"},
       3,
       "misspelled.yaml",
       "*",
       -1},
      {"a misspelled bias in the cell",
       {"train", "--cell", "rbf.yaml", "--batch", "${BATCH}", "-o", "m"},
       3,
       "rbf.yaml",
       "*",
       -1},
      {"too few poses to diagnose",
       {"diagnose", "--cell", "${CELL}", "--batch", "few.csv"},
       3,
       "*",
       ""},
      // Found on a second walk.
      {"numbers without names above them",
       {"train", "--cell", "${CELL}", "--batch", "nohead.csv", "-o", "m"},
       3,
       "nohead.csv",
       "",
       1,
       "line of names"},
      {"a web page for a table",
       {"train", "--cell", "${CELL}", "--batch", "page.csv", "-o", "m"},
       3,
       "page.csv",
       "",
       0,
       "CSV"},
      {"a real spreadsheet",
       {"train", "--cell", "${CELL}", "--batch", "real.xlsx", "-o", "m"},
       3,
       "real.xlsx",
       "",
       0,
       "CSV UTF-8"},
      {"joints in radians",
       {"train", "--cell", "${CELL}", "--batch", "rad.csv", "-o", "m"},
       3,
       "rad.csv",
       "q1_deg",
       0,
       "q1_rad"},
      {"a joint too few",
       {"train", "--cell", "${CELL}", "--batch", "five.csv", "-o", "m"},
       3,
       "five.csv",
       "*",
       0,
       ""},
      {"a quaternion of another length",
       {"train", "--cell", "${CELL}", "--batch", "quat.csv", "-o", "m"},
       3,
       "quat.csv",
       "*",
       3,
       ""},
      {"half a quaternion",
       {"train", "--cell", "${CELL}", "--batch", "quat3.csv", "-o", "m"},
       3,
       "quat3.csv",
       "*",
       0,
       "together"},
      {"a set that is none",
       {"train", "--cell", "${CELL}", "--batch", "set.csv", "-o", "m"},
       3,
       "set.csv",
       "set",
       3,
       ""},
      {"a standard deviation of nothing",
       {"train", "--cell", "${CELL}", "--batch", "sigma0.csv", "-o", "m"},
       3,
       "sigma0.csv",
       "sigma_mm",
       3,
       ""},
      {"a time of day",
       {"train", "--cell", "${CELL}", "--batch", "clock.csv", "-o", "m"},
       3,
       "clock.csv",
       "time_s",
       2,
       "digits"},
      {"a distance beside a position",
       {"train", "--cell", "${CELL}", "--batch", "dist.csv", "-o", "m"},
       3,
       "dist.csv",
       "*",
       2,
       ""},
      {"a tab before a key",
       {"train", "--cell", "tab.yaml", "--batch", "${BATCH}", "-o", "m"},
       3,
       "tab.yaml",
       "*",
       -1,
       "blanks"},
      {"grams for kilograms",
       {"train", "--cell", "grams.yaml", "--batch", "${BATCH}", "-o", "m"},
       3,
       "grams.yaml",
       "*",
       -1,
       "kg"},
      {"a key twice",
       {"train", "--cell", "dupkey.yaml", "--batch", "${BATCH}", "-o", "m"},
       3,
       "dupkey.yaml",
       "*",
       -1,
       ""},
      {"a unit behind a tolerance",
       {"train", "--cell", "tolmm.yaml", "--batch", "${BATCH}", "-o", "m"},
       3,
       "tolmm.yaml",
       "*",
       -1,
       ""},
      {"the model over its measurements",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "-o", "${BATCH}"},
       2,
       "",
       "--output",
       0,
       "another file"},
      {"a page over its measurements",
       {"report", "--model", "${MODEL}", "--batch", "${BATCH}", "-o", "${BATCH}"},
       2,
       "",
       "--output",
       0,
       "another file"},
      {"a plan over its cell",
       {"plan", "--cell", "${CELL}", "--count", "5", "-o", "${CELL}"},
       2,
       "",
       "--output",
       0,
       "another file"},
      {"a blank between sources",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "--level", "M2 gear_transmission:3",
        "-o", "m"},
       2,
       "",
       "",
       0,
       "commas"},
      {"a level that is not there",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "--level", "M4", "-o", "m"},
       2,
       "",
       "",
       0,
       "M0 to M3"},
      {"a share that is no number",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "--validation-share", "nan", "-o",
        "m"},
       2,
       "",
       "--validation-share"},
      {"percent for a share",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "--validation-share", "20", "-o", "m"},
       2,
       "",
       "--validation-share"},
      {"an option without the one that it needs",
       {"train", "--cell", "${CELL}", "--batch", "${BATCH}", "--refit", "base", "-o", "m"},
       2,
       "",
       "--refit"},
      {"a version before the first",
       {"activate", "--service", "--model", "cell-7@0", "--timeout", "0.3"},
       2,
       "",
       "--model"},
      {"an address of a page for a host",
       {"status", "--host", "http://localhost:17500", "--timeout", "0.3"},
       2,
       "",
       "--host",
       0,
       "line-3:17500"},
      {"no such store",
       {"backup", "--store", "nothing.db", "-o", "m"},
       3,
       "nothing.db",
       "",
       0,
       "server file"},
      {"neither a cell nor models", {"history", "-o", "m"}, 2, "", "--cell"},
      {"a check of nothing", {"check", "--model", "${MODEL}"}, 2, "", "--batch", 0, "plan --check"},
      {"two results on standard output",
       {"check", "--model", "${MODEL}", "--batch", "${BATCH}", "--report", "-"},
       2,
       "",
       "--json"},
      // Outputs.
      {"a plan over the poses that it is made from",
       {"plan", "--cell", "${CELL}", "--from", "plan.csv", "-o", "plan.csv"},
       2,
       "",
       "--output",
       0,
       "another file"},
      {"a plan and its program in one file",
       {"plan", "--cell", "${CELL}", "--count", "5", "-o", "p", "--rapid", "./p"},
       2,
       "",
       "--rapid",
       0,
       "another file"},
      {"corrected targets and their receipt in one file",
       {"correct", "--model", "${MODEL}", "${TARGETS}", "-o", "c", "--receipt", "c"},
       2,
       "",
       "--receipt",
       0,
       "another file"},
      {"a program into a folder that is not there",
       {"plan", "--cell", "${CELL}", "--count", "5", "-o", "p", "--rapid", "no/such/p.mod"},
       3,
       "no/such/p.mod",
       "",
       0,
       "mkdir"},
      {"a receipt into a folder that is not there",
       {"correct", "--model", "${MODEL}", "${TARGETS}", "-o", "c", "--receipt", "no/such/r.csv"},
       3,
       "no/such/r.csv",
       "",
       0,
       "mkdir"},
      // Programs.
      {"an empty program",
       {"correct", "--model", "${MODEL}", "empty.mod", "-o", "c"},
       3,
       "empty.mod",
       "",
       0,
       "--format"},
      {"a program of random bytes",
       {"correct", "--model", "${MODEL}", "random.src", "-o", "c"},
       3,
       "random.src",
       "",
       0,
       "--format"},
      {"a prediction of no program",
       {"predict", "--model", "${MODEL}", "empty.mod", "-o", "c"},
       3,
       "empty.mod",
       "",
       0,
       "--format"},
      // Found on a third walk.
      {"a model for a batch",
       {"train", "--cell", "${CELL}", "--batch", "cut.model", "-o", "m"},
       3,
       "cut.model",
       "",
       0,
       "--model"},
      {"a cell that is an empty word",
       {"plan", "--cell", "", "--count", "5", "-o", "p"},
       2,
       "",
       "--cell",
       0,
       "script"},
      {"limits the wrong way round",
       {"simulate", "--robot", "turned.yaml", "--truth", "turned.yaml", "--plan", "plan.csv", "-o",
        "b"},
       3,
       "turned.yaml",
       "*",
       -1},
      // Services.
      {"no daemon",
       {"status", "--port", "17999", "--timeout", "0.3"},
       4,
       "",
       "*",
       0,
       "trammel doctor"},
      {"a batch that is not there, for a daemon",
       {"submit", "--cell", "cell-7", "--batch", "btach.csv", "--timeout", "0.3"},
       3,
       "btach.csv",
       "",
       0,
       "batch.csv"},
  };
  return all;
}

class Mistakes : public testing::Test {
 protected:
  Mistakes() {
    folder_.write("batch.csv", kRows);
    folder_.write("plan.csv", kRows);
    folder_.write("cell-7.yaml",
                  with(test::read_file(test::shipped_cell_file()), "../models", kModels));
    std::filesystem::create_directory(folder_.file("folder"));
    folder_.write("empty.csv", "");
    folder_.write("empty.mod", "");
    folder_.write("random.src", "\x8f\x01\xe3\xff\x10\n\x99,\x02");
    folder_.write("turned.yaml",
                  with(test::read_file(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml"),
                       "[-170, 170]", "[170, -170]"));
    folder_.write("cut.model", "{\"format\": 3, \"content\": {\"cell");
    folder_.write("random.csv", "\x8f\x01\xe3\xff\x10\n\x99,\x02");
    folder_.write("batch.xlsx", std::string("PK\x03\x04\0\0\0", 7));
    folder_.write("utf16.csv", std::string("\xff\xfeq\0001\0", 6));
    folder_.write("commas.csv", with(kRows, ".5", ",5"));
    folder_.write("no-z.csv", with(kRows, "z_mm", "height"));
    folder_.write("metres.csv", with(kRows, "x_mm", "x_m"));
    folder_.write("deq.csv", with(kRows, "q3_deg", "q3_deq"));
    folder_.write("word.csv", with(kRows, "b,10.5,20.5", "b,10.5,many"));
    folder_.write("gap.csv", with(kRows, "b,10.5,20.5", "b,10.5,"));
    folder_.write("short.csv", with(kRows, "b,10.5,20.5", "b,10.5"));
    folder_.write("twice.csv", with(kRows, "\nb,", "\na,"));
    folder_.write("beyond.csv", with(kRows, "b,10.5,20.5", "b,10.5,200.5"));
    folder_.write("gripper.csv", with(with(kRows, "note", "tool_id"), "cold", "gripper"));
    folder_.write("few.csv", kRows);
    folder_.write("misspelled.yaml",
                  with(test::read_file(folder_.file("cell-7.yaml")), "gravity:", "gravty:"));
    folder_.write("rbf.yaml", std::regex_replace(test::read_file(folder_.file("cell-7.yaml")),
                                                 std::regex("bias: [a-z]+"), "bias: rbf"));
    const auto with_column = [&](const std::string& names, const std::string& first,
                                 const std::string& second) {
      const std::string named =
          with(with(kRows, ",note\n", "," + names + "\n"), "1500.5,\n", "1500.5," + first + "\n");
      return with(named, "cold", second);
    };
    folder_.write("nohead.csv", kRows.substr(kRows.find('\n') + 1));
    folder_.write("page.csv",
                  "<!DOCTYPE html><html><table><tr><td>q1_deg</td></tr></table></html>\n");
    folder_.write("rad.csv", with(kRows, "_deg", "_rad"));
    folder_.write("five.csv", with(with(kRows, ",q6_deg", ""), "20.5,0.5,1500.5", "20.5,1500.5"));
    folder_.write("quat.csv", with_column("qw,qx,qy,qz", "1,0,0,0", "1,1,0,0"));
    folder_.write("quat3.csv", with_column("qw,qx,qy", "1,0,0", "1,0,0"));
    folder_.write("set.csv", with_column("set", "train", "test"));
    folder_.write("sigma0.csv", with_column("sigma_mm", "0.01", "0"));
    folder_.write("clock.csv", with_column("time_s", "12:30:01", "12:30:05"));
    folder_.write("dist.csv", with_column("distance_mm", "100", "100"));
    const std::string cell = test::read_file(folder_.file("cell-7.yaml"));
    folder_.write("tab.yaml", with(cell, "  spindle: {xyz_mm", "\tspindle: {xyz_mm"));
    folder_.write("grams.yaml", with(cell, "mass_kg: 100,", "mass_kg: 100000,"));
    folder_.write("dupkey.yaml", cell + "gravity: [0, 0, -1]\n");
    folder_.write("tolmm.yaml", cell + "tolerance_mm: 0.2 mm\n");
    const Finished zipped = test::run({"/usr/bin/env", "-C", folder_.path(), "python3", "-c",
                                       "import zipfile; z = zipfile.ZipFile('real.xlsx', 'w'); "
                                       "z.writestr('xl/workbook.xml', '<workbook/>'); z.close()"});
    EXPECT_EQ(zipped.exit_code, 0) << zipped.err;
    const std::string on_rail =
        with(test::read_file(folder_.file("cell-7.yaml")), "-275.yaml", "-275-on-rail.yaml");
    folder_.write("rail.yaml",
                  std::regex_replace(on_rail, std::regex("joint_ranges_deg:.*\n"), ""));
    files_ = {{"${CELL}", folder_.file("cell-7.yaml")},
              {"${BATCH}", folder_.file("batch.csv")},
              {"${MODEL}", folder_.file("cut.model")},
              {"${TARGETS}", TRAMMEL_SOURCE_DIR "/config/drill-panel.csv"},
              {"${ROBOT}", TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml"},
              {"${OTHER}", folder_.file("rail.yaml")}};
  }

  static std::string with(std::string text, const std::string& what, const std::string& by) {
    for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
      text.replace(at, what.size(), by);
    return text;
  }
  [[nodiscard]] std::string meant(std::string word) const {
    for (const auto& [name, path] : files_) word = with(word, name, path);
    return word;
  }
  /// In the folder of the files, as people work.
  [[nodiscard]] Finished run(const Mistake& mistake) const {
    std::vector<std::string> argv = {"/usr/bin/env", "-C", folder_.path(),
                                     "TRAMMEL_DEFAULTS=", TRAMMEL_BINARY_DIR "/clients/trammel"};
    for (const std::string& word : mistake.words) argv.push_back(meant(word));
    if (mistake.words[0] != "help") argv.insert(argv.end(), {"--json", "-"});
    return test::run(argv);
  }

  static constexpr const char* kModels = TRAMMEL_SOURCE_DIR "/models";
  const std::string kRows =
      "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,note\n"
      "a,0.5,10.5,10.5,0.5,20.5,0.5,1500.5,0.5,1500.5,\n"
      "b,10.5,20.5,-10.5,0.5,20.5,0.5,1500.5,300.5,1500.5,cold\n"
      "c,20.5,30.5,-20.5,0.5,20.5,0.5,1500.5,600.5,1500.5,\n";
  test::TemporaryFolder folder_;
  std::vector<std::pair<std::string, std::string>> files_;
};

TEST_F(Mistakes, EachIsRefusedWithWhatWhereAndTheNextStep) {
  EXPECT_GE(mistakes().size(), 40u);
  for (const Mistake& mistake : mistakes()) {
    SCOPED_TRACE(mistake.name);
    const Finished finished = run(mistake);
    EXPECT_EQ(finished.exit_code, mistake.exit_code) << finished.err;
    const json result = json::parse(finished.out, nullptr, false);
    if (!result.is_object() || !result.contains("error")) {
      // A command that writes no JSON says it in words alone.
      EXPECT_EQ(mistake.words[0], "help") << finished.out << finished.err;
      continue;
    }
    const json& error = result["error"];
    EXPECT_FALSE(error.value("message", "").empty());
    EXPECT_FALSE(error.value("next", "").empty()) << "no next step: " << finished.err;
    EXPECT_NE(error.value("next", "").find(mistake.next), std::string::npos) << finished.err;
    if (mistake.file != "*") {
      EXPECT_EQ(error.value("file", ""), meant(mistake.file)) << finished.err;
    }
    if (mistake.field != "*" && !mistake.field.empty()) {
      EXPECT_EQ(error.value("field", ""), mistake.field) << finished.err;
    }
    if (mistake.row >= 0) {
      EXPECT_EQ(error.value("row", 0), mistake.row) << finished.err;
    }
    EXPECT_TRUE(finished.err.starts_with("trammel")) << finished.err;
    EXPECT_LE(std::count(finished.err.begin(), finished.err.end(), '\n'), 3) << finished.err;
    for (const char* written : {"m", "p", "c", "b"})
      EXPECT_FALSE(std::filesystem::exists(folder_.file(written))) << "something was written";
  }
}

TEST_F(Mistakes, NearMissesNameWhatWasMeant) {
  const auto said = [&](std::vector<std::string> words) {
    return run({"", std::move(words), 2, "", "", 0, ""}).err;
  };
  EXPECT_NE(said({"pln"}).find("did you mean plan?"), std::string::npos);
  EXPECT_NE(said({"plan", "--cel", "x"}).find("did you mean --cell?"), std::string::npos);
  EXPECT_NE(said({"train", "--validation", "0.1"}).find("did you mean --validation-share?"),
            std::string::npos);
  EXPECT_NE(said({"plan", "--cell", "cell-7.yaml", "--count", "5", "--criterion", "observabilty",
                  "-o", "p"})
                .find("did you mean observability?"),
            std::string::npos);
  EXPECT_NE(said({"help", "formts"}).find("did you mean formats?"), std::string::npos);
  EXPECT_NE(said({"train", "--cell", "misspelled.yaml", "--batch", "batch.csv", "-o", "m"})
                .find("did you mean gravity?"),
            std::string::npos);
}

TEST_F(Mistakes, WordsSayWhatIsWrongInTheUnitsOfTheUser) {
  const auto said = [&](std::vector<std::string> words) {
    return run({"", std::move(words), 2, "", "", 0, ""}).err;
  };
  const auto has = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  const std::string count = said({"plan", "--cell", "cell-7.yaml", "--count", "abc", "-o", "p"});
  EXPECT_TRUE(has(count, "--count: abc is no whole number")) << count;
  const std::string large =
      said({"plan", "--cell", "cell-7.yaml", "--count", "9999999", "-o", "p"});
  EXPECT_TRUE(has(large, "9999999 not in range 1 to 1000000")) << large;
  const std::string model =
      said({"train", "--cell", "cell-7.yaml", "--batch", "cut.model", "-o", "m"});
  EXPECT_TRUE(has(model, "this is a model file, not a batch")) << model;
  const std::string limits = said({"simulate", "--robot", "turned.yaml", "--truth", "turned.yaml",
                                   "--plan", "plan.csv", "-o", "b"});
  EXPECT_TRUE(has(limits, "lower limit 170 deg is not below upper limit -170 deg")) << limits;
  EXPECT_TRUE(has(limits, "row ")) << limits;
  const std::string cell = said({"plan", "--cell", "", "--count", "5", "-o", "p"});
  EXPECT_TRUE(has(cell, "--cell is empty")) << cell;
}

TEST_F(Mistakes, AnOutputThatIsRefusedLeavesEveryFileAsItWas) {
  const std::string before = test::read_file(folder_.file("plan.csv"));
  EXPECT_EQ(run({"", {"plan", "--cell", "cell-7.yaml", "--from", "plan.csv", "-o", "plan.csv"}, 2})
                .exit_code,
            2);
  EXPECT_EQ(test::read_file(folder_.file("plan.csv")), before);
  EXPECT_EQ(
      run({"",
           {"plan", "--cell", "cell-7.yaml", "--from", "plan.csv", "-o", "p", "--krl", "no/p.src"},
           3})
          .exit_code,
      3);
  EXPECT_FALSE(std::filesystem::exists(folder_.file("p")));
}

TEST_F(Mistakes, AnOptionalColumnThatIsNearlyAKnownOneIsTold) {
  folder_.write("near.csv", with(kRows, "pose_id", "pose_ids"));
  const std::string said =
      run({"", {"train", "--cell", "cell-7.yaml", "--batch", "near.csv", "-o", "m"}, 3}).err;
  EXPECT_NE(
      said.find("near.csv: column pose_ids is not known and is left aside; pose_id was meant?"),
      std::string::npos)
      << said;
}

TEST_F(Mistakes, ACheckOfAServerFileFindsWhatAStartOrAFirstTrainingWouldRefuse) {
  folder_.write("complience.yaml",
                with(test::read_file(folder_.file("cell-7.yaml")), "compliance", "complience"));
  folder_.write("server.yaml",
                "version: 1\nserver: here\ncells: [rbf.yaml, complience.yaml]\nstore: "
                "no/such/folder/store.db\n");
  const Finished checked = test::run(
      {TRAMMEL_BINARY_DIR "/server/trammeld", "--config", folder_.file("server.yaml"), "--check"});
  EXPECT_EQ(checked.exit_code, 3);
  for (const char* part : {"rbf", "complience", "no/such/folder"})
    EXPECT_NE(checked.err.find(part), std::string::npos) << checked.err;
}

}  // namespace
}  // namespace trammel
