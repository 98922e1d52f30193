#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "server/measurement/files/csv_table.h"
#include "tests/support/daemon.h"
#include "tests/support/process.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using nlohmann::json;
using test::Finished;

constexpr int kNotAll = 1;
constexpr int kWrongUsage = 2;
constexpr int kRefusedData = 3;
constexpr int kNoService = 4;

const std::string kTruth = TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml";

/// The program in a folder of its own.
class CommandLine : public testing::Test {
 protected:
  static Finished trammel(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), TRAMMEL_BINARY_DIR "/clients/trammel");
    return test::run(arguments, std::chrono::minutes(
                                    8));  // a diagnosis that is applied takes a minute of processor
  }
  /// Fails the test when the program does.
  static Finished must(const std::vector<std::string>& arguments) {
    Finished finished = trammel(arguments);
    EXPECT_EQ(finished.exit_code, 0) << finished.err;
    return finished;
  }
  std::string file(const std::string& name) const { return folder_.file(name); }

  /// `name`.csv: a batch of the shipped cell's virtual robot at `poses` planned poses.
  std::string measure(const std::string& name, int poses, int seed) {
    must({"plan", "--cell", cell_, "--count", std::to_string(poses), "--seed", std::to_string(seed),
          "-o", file(name + "-plan.csv")});
    must({"simulate", "--cell", cell_, "--truth", kTruth, "--plan", file(name + "-plan.csv"),
          "--seed", std::to_string(seed), "-o", file(name + ".csv")});
    return file(name + ".csv");
  }
  std::string train(const std::string& batch, const std::string& level) {
    must({"train", "--cell", cell_, "--batch", batch, "--level", level, "--bias", "none", "-o",
          file("cell.model")});
    return file("cell.model");
  }
  /// The batch with each row's field in `column` put through `change`, as a file of its own.
  std::string changed(
      const std::string& batch, const std::string& column,
      const std::function<std::string(std::size_t row, const std::string& field)>& change) {
    const CsvTable table = CsvTable::parse(test::read_file(batch), batch).value();
    const std::size_t at = table.require(column).value();
    std::string text = fmt::format("{}\n", fmt::join(table.columns(), ","));
    for (std::size_t row = 0; row < table.size(); ++row) {
      for (std::size_t k = 0; k < table.columns().size(); ++k) {
        text += k == 0 ? "" : ",";
        text += k == at ? change(row, table.field(row, k)) : table.field(row, k);
      }
      text += "\n";
    }
    return folder_.write("changed.csv", text);
  }

  /// Refused with 3, nothing written, and all of `parts` in the message.
  void expect_refused(const std::vector<std::string>& arguments,
                      const std::vector<std::string>& parts) {
    const Finished finished = trammel(arguments);
    EXPECT_EQ(finished.exit_code, kRefusedData) << finished.err;
    for (const std::string& part : parts) {
      EXPECT_NE(finished.err.find(part), std::string::npos)
          << "'" << part << "' is not in: " << finished.err;
    }
    EXPECT_FALSE(std::filesystem::exists(file("out"))) << "something was written";
  }
  void expect_training_refused(const std::string& batch, const std::vector<std::string>& parts) {
    expect_refused({"train", "--cell", cell_, "--batch", batch, "-o", file("out")}, parts);
  }

  const std::string cell_ = test::shipped_cell_file();
  test::TemporaryFolder folder_;
};

TEST_F(CommandLine, HelpOfEveryCommandEndsWith0AndNamesItsOptions) {
  const std::vector<std::pair<std::string, std::string>> commands = {
      {"plan", "--count"},     {"simulate", "--truth"}, {"train", "--level"},
      {"evaluate", "--json"},  {"report", "--batch"},   {"predict", "--joints"},
      {"correct", "input"},    {"submit", "--batch"},   {"retrain", "--bias"},
      {"status", "--timeout"}, {"watch", "--job"},      {"models", "--cell"},
      {"activate", "--model"}, {"rollback", "--cell"},  {"export", "--output"},
      {"import", "--model"}};
  for (const auto& [command, option] : commands) {
    const Finished help = must({command, "--help"});
    EXPECT_NE(help.out.find(option), std::string::npos) << command;
  }
}

/// The commands that the program itself lists.
std::vector<std::string> commands_of(const std::string& help) {
  std::vector<std::string> commands;
  std::istringstream lines(help.substr(help.find("Subcommands:")));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line) && line.starts_with("  ")) {
    if (line[2] != ' ') commands.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return commands;
}

TEST_F(CommandLine, HelpOfEveryCommandSaysTheUnitOfEveryQuantity) {
  const std::regex blanks("\\s+"), goes_with("(Needs|Excludes): --"),
      unit(", (s|mm|N)\\b|\\bshare\\b|standard deviation|\\bpulses\\b", std::regex::icase);
  int quantities = 0;
  for (const std::string& command : commands_of(must({"--help"}).out)) {
    const std::string one_line = std::regex_replace(must({command, "--help"}).out, blanks, " ");
    const std::string help = std::regex_replace(one_line, goes_with, "$1: ");
    for (auto at = help.find(" FLOAT"); at != std::string::npos; at = help.find(" FLOAT", at + 1)) {
      const std::string described = help.substr(at, help.find(" --", at) - at);
      EXPECT_TRUE(std::regex_search(described, unit)) << command << ":" << described;
      ++quantities;
    }
  }
  EXPECT_GE(quantities, 10);
}

TEST_F(CommandLine, HelpOfWhatOnlyAServiceCanDoDoesNotOfferFilesInstead) {
  for (const char* command : {"submit", "retrain", "status", "watch", "models", "activate",
                              "rollback", "export", "import"}) {
    EXPECT_EQ(must({command, "--help"}).out.find("instead of working on files"), std::string::npos)
        << command;
  }
  for (const char* command : {"predict", "correct", "diagnose"}) {
    EXPECT_NE(must({command, "--help"}).out.find("instead of working on files"), std::string::npos)
        << command;
  }
}

TEST_F(CommandLine, AStudyPutsTheSourcesFiguresBesideOurs) {
  const json study = json::parse(must({"study", "cal", "--json", "-"}).out);
  ASSERT_EQ(study["rows"].size(), 8u);
  for (const json& row : study["rows"]) {
    for (const char* side : {"ours", "thesis"}) {
      EXPECT_TRUE(row[side].contains("rms_mm") && row[side].contains("max_mm") &&
                  row[side]["axis"].contains("z"));
    }
  }
  EXPECT_EQ(study["rows"][7]["aim"]["rms_most_mm"], 0.0237);
  EXPECT_TRUE(study["parameters"][0]["levels"]["M3"].contains("thesis"));
}

TEST_F(CommandLine, WrongUsageEndsWith2AndNamesWhatIsWrong) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong = {
      {{"frobnicate"}, "frobnicate"},
      {{"train", "--cell", cell_}, "--batch is required"},
      {{"evaluate", "--model", "m", "--batch", "b", "--frob"}, "--frob"},
      {{"plan", "--cell", cell_, "--count", "-3", "-o", file("out")}, "--count"},
      {{"plan", "--cell", cell_, "--count", "many", "-o", file("out")}, "--count"},
      {{"plan", "--cell", cell_, "--count", "5", "--criterion", "luck", "-o", file("out")}, "luck"},
      {{"simulate", "--truth", kTruth, "--plan", "p.csv", "-o", file("out")}, "--robot"},
      {{"train", "--cell", cell_, "--batch", "b", "--validation-share", "1.5", "-o", file("out")},
       "--validation-share"},
      {{"correct", "--model", "m", "program.xyz", "-o", file("out")},
       "unknown kind of targets '.xyz'"},
      {{"activate", "--model", "cell-7", "--timeout", "0.1"}, "expected cell@version"},
  };
  for (const auto& [arguments, part] : wrong) {
    const Finished finished = trammel(arguments);
    EXPECT_EQ(finished.exit_code, kWrongUsage) << part;
    EXPECT_NE((finished.err + finished.out).find(part), std::string::npos) << finished.err;
    EXPECT_EQ(finished.out, "") << "errors belong on standard error";
  }
}

TEST_F(CommandLine, ARefusalIsDataWhereTheResultWasToBeJsonOnStandardOutput) {
  const std::string batch = folder_.write("bad.csv", "q1_deg,x_mm,y_mm,z_mm\n1,2,3,4\n1,2,3e7,4\n");
  const Finished refused = trammel({"diagnose", "--cell", cell_, "--batch", batch, "--json", "-"});
  EXPECT_EQ(refused.exit_code, kRefusedData);
  const json error = json::parse(refused.out).at("error");
  EXPECT_EQ(error.at("code"), "refused");
  EXPECT_EQ(error.at("file"), batch);
  EXPECT_EQ(error.at("row"), 3);
  EXPECT_EQ(error.at("field"), "y_mm");
  EXPECT_EQ(error.at("value"), 3e7);
  EXPECT_EQ(error.at("limit"), 1e6);
  EXPECT_EQ(refused.err, "trammel diagnose: " + error.at("sentence").get<std::string>() + "\n");
  const Finished into_file =
      trammel({"diagnose", "--cell", cell_, "--batch", batch, "--json", file("out")});
  EXPECT_EQ(into_file.exit_code, kRefusedData);
  EXPECT_EQ(into_file.out, "");
  EXPECT_FALSE(std::filesystem::exists(file("out"))) << "a file stays as it was";
}

TEST_F(CommandLine, ALevelThatDoesNotExistIsWrongUsage) {
  const std::string batch = measure("b", 20, 1);
  const Finished finished =
      trammel({"train", "--cell", cell_, "--batch", batch, "--level", "M9", "-o", file("out")});
  EXPECT_EQ(finished.exit_code, kWrongUsage);
  EXPECT_NE(finished.err.find("M9"), std::string::npos) << finished.err;
}

TEST_F(CommandLine, AModelThatTheCellFileSpellsWrongIsRefusedWithItsRow) {
  const std::string batch =
      folder_.write("b.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n");
  const auto cell_with = [&](const std::string& model) {
    std::string text = test::small_cell_yaml("cell-7");
    text.replace(text.find("model:"), std::string::npos, "model:\n  " + model + "\n");
    folder_.write("robot.yaml", test::small_robot_yaml());
    return folder_.write("cell.yaml", text);
  };
  for (const char* model : {"error_sources: [base, complience]", "error_sources: [base, base]",
                            "bias: sse", "bias: \"se +\""}) {
    const std::string cell = cell_with(model);
    for (const std::string command : {"train", "diagnose"}) {
      expect_refused(
          {command, "--cell", cell, "--batch", batch, command == "train" ? "-o" : "--report",
           file("out")},
          {cell + " row 8: model: " + std::string(model).substr(0, std::string(model).find(':'))});
    }
  }
  const Finished seed =
      trammel({"train", "--cell", cell_, "--batch", batch, "--seed", "-1", "-o", file("out")});
  EXPECT_EQ(seed.exit_code, kWrongUsage);
  EXPECT_NE(seed.err.find("--seed: '-1', expected a whole number from 0"), std::string::npos)
      << seed.err;
}

TEST_F(CommandLine, WhatForeignFilesSayControlsNoTerminal) {
  const std::string batch =
      folder_.write("b.csv",
                    "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,pose_id\n"
                    "1,2,3,4,5,6,1,2,3,\x1b]0;owned\a\n");
  const Finished finished =
      trammel({"train", "--cell", cell_, "--batch", batch, "-o", file("out")});
  EXPECT_EQ(finished.exit_code, kRefusedData);
  EXPECT_NE(finished.err.find("row 2: '\\u001b]0;owned\\u0007'"), std::string::npos)
      << finished.err;
  EXPECT_EQ((finished.err + finished.out).find('\x1b'), std::string::npos);
  const Finished usage =
      trammel({"train", "--cell", cell_, "--batch", batch, "-o", file("out"), "\x1b[2J"});
  EXPECT_EQ((usage.err + usage.out).find('\x1b'), std::string::npos);
  EXPECT_NE(usage.err.find("\\u001b[2J"), std::string::npos) << usage.err;
}

TEST_F(CommandLine, RefittingTheBaseOnThreePositionsKeepsAToolThatTheCellDoesNotKnowAndAllElse) {
  std::string cell = test::read_file(cell_);
  const auto replace = [&](const std::string& what, const std::string& by) {
    ASSERT_NE(cell.find(what), std::string::npos) << what;
    cell.replace(cell.find(what), what.size(), by);
  };
  replace("../models", TRAMMEL_SOURCE_DIR "/models");
  replace("base: {xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}", "base: null");
  replace("spindle: {xyz_mm: [100, 0, 150], q_wxyz: [0.923879532511287, 0, -0.382683432365090, 0]}",
          "spindle: null");
  const std::string unlocated = folder_.write("unlocated.yaml", cell);
  must({"train", "--cell", unlocated, "--batch", measure("b", 80, 3), "--bias", "se", "-o",
        file("first.model")});
  // Positions alone, the wrist never turned.
  const std::string joints = folder_.write("few-plan.csv",
                                           "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
                                           "-40,10,10,0,20,0\n35,10,10,0,20,0\n0,30,-10,0,20,0\n");
  must({"simulate", "--cell", cell_, "--truth", kTruth, "--plan", joints, "--seed", "9", "-o",
        file("full.csv")});
  const CsvTable full = CsvTable::parse(test::read_file(file("full.csv")), "full.csv").value();
  std::string few = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n";
  for (std::size_t row = 0; row < full.size(); ++row) {
    std::vector<std::string> fields;
    for (const char* name :
         {"q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg", "x_mm", "y_mm", "z_mm"})
      fields.push_back(full.field(row, full.require(name).value()));
    few += fmt::format("{}\n", fmt::join(fields, ","));
  }
  const Finished refit =
      must({"train", "--cell", unlocated, "--batch", folder_.write("few.csv", few), "--from",
            file("first.model"), "--refit", "base", "-o", file("second.model")});
  EXPECT_NE(refit.out.find("base position identified anew on 3 poses of batch few"),
            std::string::npos)
      << refit.out;
  const json first = json::parse(test::read_file(file("first.model")))["content"];
  const json second = json::parse(test::read_file(file("second.model")))["content"];
  for (const char* kept : {"tools", "bias", "rotation_bias", "q_min", "q_max", "prior_share_limit",
                           "trained_with", "extrapolation_slope", "error_sources"}) {
    EXPECT_EQ(second.value(kept, json()), first.value(kept, json())) << kept;
  }
  std::size_t same = 0;
  for (std::size_t k = 0; k < first["parameters"].size(); ++k)
    same += first["parameters"][k] == second["parameters"][k] ? 1 : 0;
  EXPECT_EQ(same, first["parameters"].size() - 6);
  EXPECT_NE(second["X_WB"], first["X_WB"]);
}

TEST_F(CommandLine, AToolThatIsTurnedAsTheNewCellFileSaysIsRefitted) {
  const std::string first = train(measure("b", 60, 5), "M2");
  std::string cell = test::read_file(cell_);
  cell.replace(cell.find("../models"), 9, TRAMMEL_SOURCE_DIR "/models");
  const std::string was = "q_wxyz: [0.923879532511287, 0, -0.382683432365090, 0]}";
  ASSERT_NE(cell.find(was), std::string::npos);
  cell.replace(cell.find(was), was.size(), "q_wxyz: [1, 0, 0, 0]}");  // by 45 degrees
  const std::string turned = folder_.write("turned.yaml", cell);
  must({"plan", "--cell", turned, "--count", "20", "--seed", "6", "-o", file("plan.csv")});
  must({"simulate", "--cell", turned, "--truth", kTruth, "--plan", file("plan.csv"), "--seed", "6",
        "-o", file("few.csv")});
  must({"train", "--cell", turned, "--batch", file("few.csv"), "--from", first, "--refit", "tool",
        "-o", file("second.model")});
  const Finished refused = trammel({"train", "--cell", cell_, "--batch", file("few.csv"), "--from",
                                    first, "--refit", "tool", "-o", file("no")});
  EXPECT_EQ(refused.exit_code, kRefusedData);
  EXPECT_NE(refused.err.find("turned by 45 deg against tool 'spindle' of the cell file"),
            std::string::npos)
      << refused.err;
}

std::vector<std::string> codes_of(const json& notes) {
  std::vector<std::string> codes;
  for (const json& note : notes) codes.push_back(note.at("code"));
  return codes;
}

TEST_F(CommandLine, TrainFindsTheLoadThatComplianceActsOnWhereNoMassIsTold) {
  std::string cell = test::read_file(cell_);
  cell.replace(cell.find("../models"), 9, TRAMMEL_SOURCE_DIR "/models");
  const std::size_t payloads = cell.find("payloads:");
  cell.erase(payloads, cell.find("tracker:") - payloads);
  const std::string unloaded = folder_.write("unloaded.yaml", cell);
  const std::string batch =
      changed(measure("b", 60, 4), "payload_id", [](auto, const auto&) { return ""; });
  const Finished said = must({"train", "--cell", unloaded, "--batch", batch, "--level", "M3",
                              "--bias", "none", "-o", file("m3.model"), "--json", file("m3.json")});
  EXPECT_NE(said.out.find("the robot file tells no link masses"), std::string::npos) << said.out;
  EXPECT_NE(said.out.find("found from the poses (self_weight)"), std::string::npos) << said.out;
  const json told = json::parse(test::read_file(file("m3.json")));
  EXPECT_EQ(codes_of(told["notes"]),
            (std::vector<std::string>{"added_by_data", "robot_not_confirmed"}));
  const json fresh = json::parse(
      must({"evaluate", "--model", file("m3.model"), "--batch",
            changed(measure("v", 200, 5), "payload_id", [](auto, const auto&) { return ""; }),
            "--json", "-"})
          .out);
  EXPECT_LT(fresh["levels"]["calibrated"]["rms_mm"].get<double>(), 0.03)
      << "of 3.8 mm that the load bends the arm";
  const json found =
      json::parse(must({"diagnose", "--cell", unloaded, "--batch", batch, "--json", "-"}).out);
  EXPECT_EQ(found["verdict"], "nothing") << found["sentence"];
  EXPECT_LT(found["before"]["rms_mm"].get<double>(), 0.05)
      << "what the links weigh is not left over";
  EXPECT_NE(found["limits"].dump().find("self_weight"), std::string::npos) << found["limits"];
}

TEST_F(CommandLine, FromPlanToEvaluationOnFilesAlone) {
  const std::string model = train(measure("b", 60, 1), "M3");
  const Finished evaluated =
      must({"evaluate", "--model", model, "--batch", measure("v", 50, 2), "--json", "-"});
  const json result = json::parse(evaluated.out);
  EXPECT_EQ(result.at("poses"), 50);
  EXPECT_GT(result.at("levels").at("nominal").at("rms_mm"), 5.0);
  EXPECT_LT(result.at("levels").at("calibrated").at("rms_mm"), 0.05);
  EXPECT_EQ(result.at("rms_mm"), result.at("levels").at("compensated").at("rms_mm"));
  for (const json& figures :
       {result, result.at("levels").at("nominal"), result.at("levels").at("compensated")}) {
    for (const char* key : {"rms_mm", "mean_mm", "p997_mm", "max_mm"})
      EXPECT_TRUE(figures.at(key).is_number()) << key;
    for (const char* axis : {"x", "y", "z"}) {
      EXPECT_TRUE(figures.at("axis").at(axis).at("mean_mm").is_number());
      EXPECT_TRUE(figures.at("axis").at(axis).at("std_mm").is_number());
    }
  }
  EXPECT_GE(result.at("coverage_95"), 0.0);
  EXPECT_LE(result.at("in_domain"), 50);
}

TEST_F(CommandLine, TheSameSeedGivesTheSameBytes) {
  const std::string first = test::read_file(measure("b", 20, 5));
  EXPECT_EQ(test::read_file(measure("b", 20, 5)), first);
  EXPECT_NE(test::read_file(measure("b", 20, 6)), first);
}

TEST_F(CommandLine, TrainingSaysHowGoodTheModelIsAndWhatItCouldNotTell) {
  const Finished trained =
      must({"train", "--cell", cell_, "--batch", measure("b", 60, 1), "--level", "M2", "--bias",
            "none", "--validation-share", "0.25", "-o", file("m")});
  for (const char* part :
       {"nominal", "calibrated", "compensated", "not identifiable", "15 poses held out"}) {
    EXPECT_NE(trained.out.find(part), std::string::npos) << part << " is not in:\n" << trained.out;
  }
  EXPECT_EQ(trained.err, "") << "no progress in a pipe";
}

TEST_F(CommandLine, AResultForProgramsOnStandardOutputStandsThereAlone) {
  const std::string batch = measure("b", 30, 1);
  const Finished trained = must({"train", "--cell", cell_, "--batch", batch, "--level", "M1",
                                 "--bias", "none", "-o", file("m"), "--json", "-"});
  const json result = json::parse(trained.out);
  EXPECT_EQ(result.at("level"), "base");
  EXPECT_EQ(result.at("training_poses"), 30);
  EXPECT_EQ(result.at("parameters").size(), 6u);
}

TEST_F(CommandLine, PredictionsCarryErrorUncertaintyDomainAndPose) {
  const std::string batch = measure("b", 40, 1);
  const std::string model = train(batch, "M1");
  must({"predict", "--model", model, "--joints", file("b-plan.csv"), "-o", file("p.csv")});
  const CsvTable table = CsvTable::parse(test::read_file(file("p.csv")), "p.csv").value();
  ASSERT_EQ(table.size(), 40u);
  for (const char* column : {"dx_mm", "dy_mm", "dz_mm", "sx_mm", "sy_mm", "sz_mm", "in_domain",
                             "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"}) {
    EXPECT_TRUE(table.number(0, table.require(column).value())) << column;
  }
  EXPECT_EQ(table.number(0, table.require("in_domain").value()).value(), 1);
  EXPECT_GT(table.number(0, table.require("sx_mm").value()).value(), 0);
}

TEST_F(CommandLine, AVirtualRobotSentToCorrectedTargetsLandsWhereItWasWanted) {
  const std::string model = train(measure("b", 80, 1), "M3");
  must({"plan", "--cell", cell_, "--count", "20", "--seed", "9", "-o", file("wanted.csv")});
  const Finished nominal = must({"predict", "--model", model, "--joints", file("wanted.csv"), "-o",
                                 file("p.csv"), "--json", "-"});
  must({"correct", "--model", model, file("wanted.csv"), "-o", file("c.csv"), "--allow-failed"});

  const CsvTable corrected = CsvTable::parse(test::read_file(file("c.csv")), "c.csv").value();
  const json wanted = json::parse(nominal.out).at("predictions");
  ASSERT_EQ(corrected.size(), 20u);
  std::string sent = "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n";
  for (std::size_t row = 0; row < corrected.size(); ++row) {
    if (corrected.field(row, corrected.require("status").value()) != "ok") continue;
    const double expected =
        corrected.number(row, corrected.require("error_after_mm").value()).value();
    EXPECT_GT(expected, 1e-3) << "an error of the model, not what the iteration leaves";
    EXPECT_LT(expected, 0.1);
    sent += std::to_string(row);
    for (int j = 1; j <= 6; ++j) {
      sent += "," + corrected.field(row, corrected.require(fmt::format("q{}_deg", j)).value());
    }
    sent += "\n";
  }
  must({"simulate", "--cell", cell_, "--truth", kTruth, "--plan", folder_.write("sent.csv", sent),
        "-o", file("m.csv")});
  const CsvTable landed = CsvTable::parse(test::read_file(file("m.csv")), "m.csv").value();
  ASSERT_GT(landed.size(), 12u) << test::read_file(file("c.csv"));
  for (std::size_t row = 0; row < landed.size(); ++row) {
    const auto target = static_cast<std::size_t>(std::stoi(landed.field(row, 0)));
    double squared = 0;  // cell-7 stands at the origin of W
    for (const char* column : {"x_mm", "y_mm", "z_mm"}) {
      const double measured = landed.number(row, landed.require(column).value()).value();
      squared += std::pow(measured - wanted.at(target).at("nominal").at(column).get<double>(), 2);
    }
    EXPECT_LT(std::sqrt(squared), 0.15)
        << "target " << target;  // noise of 0.013 mm an axis and what the fit leaves
  }
}

TEST_F(CommandLine, TargetsWithoutACorrectionSayWhyAndCarryNoNumbers) {
  const std::string model = train(measure("b", 40, 1), "M1");
  const std::string targets =
      folder_.write("t.csv",
                    "x_mm,y_mm,z_mm,qw,qx,qy,qz,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
                    "9000,0,1000,1,0,0,0,0,0,0,0,30,0\n");
  const Finished corrected = trammel({"correct", "--model", model, targets, "-o", file("c.csv")});
  EXPECT_EQ(corrected.exit_code, kNotAll);
  EXPECT_NE(corrected.err.find("1 targets: 1 unreachable"), std::string::npos) << corrected.err;
  EXPECT_NE(corrected.err.find("t.csv row 2: unreachable"), std::string::npos) << corrected.err;
  const CsvTable table = CsvTable::parse(test::read_file(file("c.csv")), "c.csv").value();
  EXPECT_EQ(table.field(0, table.require("row").value()), "2");
  EXPECT_EQ(table.field(0, table.require("status").value()), "unreachable");
  for (const char* column :
       {"x_mm", "qw", "q1_deg", "error_before_mm", "error_after_mm", "sigma_mm"}) {
    EXPECT_EQ(table.field(0, table.require(column).value()), "") << column;
  }
  EXPECT_NE(table.field(0, table.require("message").value()), "");
}

TEST_F(CommandLine, TargetsOfATableAreHeldAgainstATolerance) {
  const std::string model = train(measure("b", 60, 1), "M3");
  const std::string targets =
      folder_.write("t.csv",
                    "x_mm,y_mm,z_mm,qw,qx,qy,qz,conf\n"
                    "1800,100,1200,0.7071067811865476,0,0.7071067811865476,0,0\n"
                    "1800,-100,1200,0.7071067811865476,0,0.7071067811865476,0,0\n"
                    "9000,0,1000,1,0,0,0,0\n");
  const auto inside = [&](const std::string& tolerance) {
    const Finished corrected = trammel({"correct", "--model", model, targets, "-o", file("c.csv"),
                                        "--json", file("c.json"), "--tolerance", tolerance});
    EXPECT_NE(corrected.err.find("tolerance " + tolerance + " mm: "), std::string::npos)
        << corrected.err;
    EXPECT_NE(corrected.err.find("of 1 the error is not known"), std::string::npos)
        << corrected.err;
    const json verdict = json::parse(test::read_file(file("c.json"))).at("tolerance");
    EXPECT_EQ(verdict.at("targets"), 2);
    return std::pair<int, int>(verdict.at("inside_before"), verdict.at("inside_after"));
  };
  EXPECT_EQ(inside("0.8"), (std::pair{0, 2}))
      << "millimetres off before, some tenths at most after";
  EXPECT_EQ(inside("0.001"), (std::pair{0, 0}));
}

TEST_F(CommandLine, AJointTargetOutsideTheLimitsIsAStatusNotARefusal) {
  const std::string model = train(measure("b", 40, 1), "M1");
  const std::string targets = folder_.write("t.csv",
                                            "hole,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
                                            "7,10,10,-20,30,40,50\n8,10,10,71,30,40,50\n");
  EXPECT_EQ(trammel({"correct", "--model", model, targets, "-o", file("c.csv")}).exit_code,
            kNotAll);
  const CsvTable table = CsvTable::parse(test::read_file(file("c.csv")), "c.csv").value();
  const auto field = [&](std::size_t row, const char* column) {
    return table.field(row, table.require(column).value());
  };
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(field(0, "status"), "ok");
  EXPECT_EQ(field(1, "status"), "joint_limit");
  EXPECT_EQ(field(1, "hole"), "8");
  EXPECT_EQ(field(1, "row"), "3");
  EXPECT_EQ(field(1, "input_q3_deg"), "71");
  EXPECT_NE(field(1, "message").find("joint 3 would be at 71.0 deg, limit 70"), std::string::npos)
      << field(1, "message");
  EXPECT_GT(std::stod(field(1, "error_before_mm")), 0.1);
  EXPECT_EQ(field(1, "error_after_mm"), field(1, "error_before_mm"));
}

TEST_F(CommandLine, TargetsLeftAsTheyWereEndWith1UnlessTheyAreAllowedOrNothingIsToBeWritten) {
  const std::string model = train(measure("b", 40, 1), "M1");
  const std::string targets = folder_.write("t.csv",
                                            "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
                                            "10,10,-20,30,40,50\n10,10,71,30,40,50\n");
  EXPECT_EQ(trammel({"correct", "--model", model, targets, "-o", file("c.csv")}).exit_code,
            kNotAll);
  const std::string corrected = test::read_file(file("c.csv"));
  must({"correct", "--model", model, targets, "-o", file("allowed.csv"), "--allow-failed"});
  EXPECT_EQ(test::read_file(file("allowed.csv")), corrected);
  expect_refused({"correct", "--model", model, targets, "-o", file("out"), "--strict"},
                 {"nothing is written", "1 of 2 targets", "t.csv row 3", "joint 3", "limit 70"});
  const Finished both = trammel(
      {"correct", "--model", model, targets, "-o", file("out"), "--strict", "--allow-failed"});
  EXPECT_EQ(both.exit_code, kWrongUsage);
  const std::string good =
      folder_.write("g.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,10,-20,30,40,50\n");
  must({"correct", "--model", model, good, "-o", file("g.out"), "--strict"});
}

TEST_F(CommandLine, ABadNumberInOneTargetRefusesTheWholeFile) {
  const std::string model = train(measure("b", 40, 1), "M1");
  const std::string head = "x_mm,y_mm,z_mm,qw,qx,qy,qz,conf\n1500,0,1500,1,0,0,0,0\n";
  const auto expect_row_refused = [&](const std::string& row,
                                      const std::vector<std::string>& parts) {
    expect_refused(
        {"correct", "--model", model, folder_.write("t.csv", head + row), "-o", file("out")},
        parts);
  };
  expect_row_refused("1500,nan,1500,1,0,0,0,0\n", {"t.csv row 3", "y_mm is nan"});
  expect_row_refused("1500,0,1500,1,0.1,0,0,0\n",
                     {"t.csv row 3", "quaternion", "1.00499", "limit 0.001"});
  expect_row_refused("1500,0,1500,1,0,0,0,8\n", {"t.csv row 3", "conf is 8", "0 to 7"});
  expect_row_refused("1500,0,1500,1,0,0,0,\n", {"t.csv row 3", "neither conf nor joints"});
}

TEST_F(CommandLine, RefusesBatchesThatAreNoneAndSaysWhy) {
  expect_training_refused(folder_.write("b.csv", ""), {"b.csv", "empty file"});
  expect_training_refused(folder_.write("b.csv", "q1_deg,x_mm,y_mm\n1,2,3\n"),
                          {"b.csv", "missing column z_mm"});
  expect_training_refused(folder_.write("b.csv", std::string("\x7F"
                                                             "ELF\0\1\2\n",
                                                             8)),
                          {"b.csv"});
  expect_training_refused(file("nowhere.csv"), {"nowhere.csv", "no such file"});
}

TEST_F(CommandLine, RefusesBadValuesWithFileRowValueAndLimit) {
  const std::string batch = measure("b", 20, 1);
  const auto in_row_4 = [](const std::string& value) {
    return [value](std::size_t row, const std::string& field) { return row == 2 ? value : field; };
  };
  expect_training_refused(changed(batch, "y_mm", in_row_4("nan")),
                          {"changed.csv row 4", "y_mm", "nan"});
  expect_training_refused(changed(batch, "q3_deg", in_row_4("71.5")),
                          {"changed.csv row 4", "joint 3", "71.5 deg", "limit 70"});
  expect_training_refused(changed(batch, "tool_id", in_row_4("saw")),
                          {"changed.csv row 4", "unknown tool 'saw'", "spindle"});
}

TEST_F(CommandLine, RefusesFiveJointsForARobotOfSix) {
  std::string five = test::read_file(measure("b", 20, 1));
  five.replace(five.find("q6_deg"), 6, "j6_deg");
  expect_training_refused(folder_.write("five.csv", five),
                          {"five.csv", "5 joint columns", "has 6"});
}

TEST_F(CommandLine, RefusesJointsInRadiansAndNamesBothSpreads) {
  std::string batch = measure("b", 40, 1);
  for (int j = 1; j <= 6; ++j) {
    batch = changed(batch, fmt::format("q{}_deg", j), [](std::size_t, const std::string& field) {
      return fmt::format("{}", std::stod(field) / 57.29578);
    });
  }
  expect_training_refused(batch, {"changed.csv", "radians", "spread over", "move the tool over"});
}

TEST_F(CommandLine, RefusesAFileThatIsNoModel) {
  const std::string batch = measure("b", 20, 1);
  expect_refused(
      {"evaluate", "--model", folder_.write("garbage.model", "what is this"), "--batch", batch},
      {"garbage.model"});
  expect_refused({"evaluate", "--model", file("nowhere.model"), "--batch", batch},
                 {"nowhere.model", "no such file"});
  expect_refused({"predict", "--model", batch, "--joints", batch, "-o", file("out")}, {"b.csv"});
}

TEST_F(CommandLine, AModelThatWasTamperedWithIsRefused) {
  std::string text = test::read_file(train(measure("b", 20, 1), "M1"));
  const std::size_t digit = text.find_last_of("123456789");
  text[digit] = text[digit] == '9' ? '8' : static_cast<char>(text[digit] + 1);
  expect_refused({"report", "--model", folder_.write("t.model", text), "-o", file("out")},
                 {"t.model"});
}

TEST_F(CommandLine, AnOutputThatCannotBeWrittenIsRefusedAndLeavesNoPart) {
  const std::string nowhere = file("no/such/folder/plan.csv");
  expect_refused({"plan", "--cell", cell_, "--count", "5", "-o", nowhere},
                 {nowhere, "cannot be written"});
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

TEST_F(CommandLine, AFailedTrainingLeavesTheOldModelAsItWas) {
  const std::string model = train(measure("b", 20, 1), "M1");
  const std::string before = test::read_file(model);
  const Finished failed =
      trammel({"train", "--cell", cell_, "--batch", file("nowhere.csv"), "-o", model});
  EXPECT_EQ(failed.exit_code, kRefusedData);
  EXPECT_EQ(test::read_file(model), before);
}

TEST_F(CommandLine, NoOutputOverwritesTheRobotFileThatTheCellNames) {
  const std::string robot = folder_.write(
      "arm.yaml", test::read_file(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml"));
  std::string text = test::read_file(cell_);
  const std::size_t at = text.find("robot: "), end = text.find('\n', at);
  const std::string cell =
      folder_.write("cell.yaml", text.replace(at, end - at, "robot: arm.yaml"));
  const std::string before = test::read_file(robot);
  const Finished finished = trammel({"plan", "--cell", cell, "--count", "20", "-o", robot});
  EXPECT_EQ(finished.exit_code, kWrongUsage) << finished.err;
  EXPECT_NE(finished.err.find("would overwrite the robot file"), std::string::npos) << finished.err;
  EXPECT_EQ(test::read_file(robot), before);
}

TEST_F(CommandLine, TheReportIsOnePageWithItsChartsInside) {
  const std::string batch = measure("b", 30, 1);
  must({"report", "--model", train(batch, "M2"), "--batch", batch, "-o", file("r.html")});
  const std::string page = test::read_file(file("r.html"));
  EXPECT_NE(page.find("Chart.js v"), std::string::npos);
  EXPECT_NE(page.find("gamma0"), std::string::npos);
  EXPECT_EQ(page.find("src=\"http"), std::string::npos);
  EXPECT_EQ(page.find("{{"), std::string::npos);
}

TEST_F(CommandLine, PosesThatAModelWasTrainedOnDoNotJudgeIt) {
  const std::string batch = measure("b", 60, 1), fresh = measure("f", 30, 2);
  const std::string model = train(batch, "M2");
  const auto page_of = [&](const std::string& of, const std::string& said) {
    const Finished told = must({"report", "--model", model, "--batch", of, "-o", file("r.html")});
    EXPECT_NE(told.out.find(said), std::string::npos) << told.out;
    return test::read_file(file("r.html"));
  };
  const auto evaluated = [&](const std::string& of) {
    return json::parse(must({"evaluate", "--model", model, "--batch", of, "--json", "-"}).out);
  };
  EXPECT_NE(page_of(batch, "60 of the 60 poses").find("none was held out"), std::string::npos);
  EXPECT_NE(page_of(fresh, "report of model").find("30 poses that were not trained on"),
            std::string::npos);
  EXPECT_EQ(evaluated(batch).at("trained_on"), 60);
  EXPECT_FALSE(evaluated(fresh).contains("trained_on"));
}

/// A truth file whose joint 3 oscillates besides, which the shipped cell does not know.
std::string oscillating_truth(const test::TemporaryFolder& folder) {
  std::string truth = test::read_file(kTruth);
  const std::string noise = "noise:";
  truth.insert(truth.find(noise), "  gear_transmission:3@48.5: {gear_sin3_rad: 4.0e-5}\n");
  return folder.write("oscillating.yaml", truth);
}

TEST_F(CommandLine, ADiagnosisNamesTheGearAndExtendsTheCellByIt) {
  must({"plan", "--cell", cell_, "--count", "150", "-o", file("plan.csv")});
  must({"simulate", "--cell", cell_, "--truth", oscillating_truth(folder_), "--plan",
        file("plan.csv"), "-o", file("batch.csv")});
  const Finished applied =
      must({"diagnose", "--cell", cell_, "--batch", file("batch.csv"), "--json", file("found.json"),
            "--report", file("page.html"), "--next-poses", file("next.csv"), "--apply",
            "--cell-out", file("extended.yaml"), "--model", file("extended.model")});
  const json found = json::parse(test::read_file(file("found.json")));
  EXPECT_EQ(found.at("verdict"), "named") << applied.out;
  ASSERT_EQ(found.at("findings").size(), 1u);
  EXPECT_EQ(found.at("findings").at(0).at("cause"), "gear_transmission");
  EXPECT_EQ(found.at("findings").at(0).at("joint"), 3);
  const json& order = found.at("findings").at(0).at("parameters").at("order");
  EXPECT_NEAR(order.at("value").get<double>(), 48.5, 0.3);
  EXPECT_TRUE(found.at("applied").at("better").get<bool>());
  EXPECT_LT(found.at("applied").at("after").at("rms_mm").get<double>(),
            found.at("applied").at("before").at("rms_mm").get<double>());
  EXPECT_NE(test::read_file(file("page.html")).find("gear ripple"), std::string::npos);

  const std::string before = test::read_file(cell_);
  const std::string after = test::read_file(file("extended.yaml"));
  const std::string list = "[base, geometry, compliance";
  EXPECT_NE(after.find(list + ", gear_transmission:3@48."), std::string::npos) << after;
  EXPECT_EQ(after.substr(0, after.find(list)), before.substr(0, before.find(list)));
  const json evaluated = json::parse(must({"evaluate", "--model", file("extended.model"), "--batch",
                                           file("batch.csv"), "--json", "-"})
                                         .out);
  EXPECT_LT(evaluated.at("rms_mm").get<double>(), 0.04);
}

/// The shipped cell that may be measured in a small part of its ranges only.
std::string narrow_cell(const test::TemporaryFolder& folder, const std::string& cell) {
  std::string text = test::read_file(cell);
  text = std::regex_replace(text, std::regex("joint_ranges_deg:.*"),
                            "joint_ranges_deg: {q1: [-40, 40], q2: [-30, 30], q3: [-40, 30], q4: "
                            "[-60, 60], q5: [-60, 60], q6: [-90, 90]}");
  const std::string robot =
      std::filesystem::path(cell).parent_path() / "../models/abb_irb6640-205-275.yaml";
  text = std::regex_replace(text, std::regex("robot: .*"), "robot: " + robot);
  return folder.write("narrow.yaml", text);
}

TEST_F(CommandLine, WhatOneBatchLeavesOpenTheNextPosesDecide) {
  std::string truth = test::read_file(kTruth);
  truth.insert(truth.find("noise:"),
               "  encoder_eccentricity:3: {ecc_sin3_rad: 3.0e-4, ecc_cos3_rad: 3.0e-4}\n");
  truth = folder_.write("eccentric.yaml", truth);
  const auto simulated = [&](const std::string& plan, const std::string& seed,
                             const std::string& batch) {
    must({"simulate", "--cell", cell_, "--truth", truth, "--plan", plan, "--seed", seed, "-o",
          batch});
    return batch;
  };
  must({"plan", "--cell", narrow_cell(folder_, cell_), "--count", "60", "-o", file("plan.csv")});
  const std::string first = simulated(file("plan.csv"), "1", file("first.csv"));
  must({"diagnose", "--cell", cell_, "--batch", first, "--json", file("first.json"), "--next-poses",
        file("next.csv")});
  const json open = json::parse(test::read_file(file("first.json")));
  ASSERT_EQ(open.at("verdict"), "ambiguous");
  ASSERT_EQ(open.at("next_poses").size(), 10u);

  must({"plan", "--cell", cell_, "--from", file("next.csv"), "-o", file("more.csv")});
  EXPECT_EQ(CsvTable::parse(test::read_file(file("more.csv")), "more.csv").value().size(), 10u)
      << "all are taken";
  const std::string second = simulated(file("more.csv"), "2", file("second.csv"));
  must({"diagnose", "--cell", cell_, "--batch", first, "--batch", second, "--json",
        file("both.json")});
  const json decided = json::parse(test::read_file(file("both.json")));
  EXPECT_EQ(decided.at("verdict"), "named");
  ASSERT_EQ(decided.at("findings").size(), 1u);
  EXPECT_EQ(decided.at("findings").at(0).at("cause"), "encoder_eccentricity");
  EXPECT_EQ(decided.at("findings").at(0).at("joint"), 3);
}

TEST_F(CommandLine, ADiagnosisSaysFromWherePosesAreOfATrackerThatWasMovedFar) {
  const std::string batch =
      changed(measure("b", 80, 1), "x_mm", [](std::size_t row, const std::string& x) {
        return row < 40 ? x : fmt::format("{:.4f}", std::stod(x) + 30);
      });
  const json found =
      json::parse(must({"diagnose", "--cell", cell_, "--batch", batch, "--json", "-"}).out);
  const std::string said = found["sentence"];
  EXPECT_TRUE(std::regex_search(
      said, std::regex("pose 41 \\(row 42\\) on: the tracker moved, (29\\.[5-9]|30\\.[0-4])")))
      << said;
}

TEST_F(CommandLine, ADiagnosisThatNamesNothingExtendsNothing) {
  const Finished finished =
      trammel({"diagnose", "--cell", cell_, "--batch", measure("good", 80, 1), "--json",
               file("found.json"), "--apply", "--cell-out", file("out")});
  EXPECT_EQ(finished.exit_code, kNotAll) << finished.out;
  EXPECT_NE(finished.err.find("not applied: "), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("no cause was named"), std::string::npos) << finished.err;
  EXPECT_FALSE(std::filesystem::exists(file("out")));
  EXPECT_EQ(json::parse(test::read_file(file("found.json"))).at("verdict"), "nothing");
}

TEST_F(CommandLine, ATrainingFromAModelTakesNoBatchThatRefittingDoesNotExplain) {
  const std::string batch = measure("b", 60, 1);
  const std::string model = train(batch, "M3");
  must({"train", "--cell", cell_, "--batch", batch, "--from", model, "--bias", "none", "-o",
        file("again.model")});
  const std::string spoilt = changed(batch, "z_mm", [](std::size_t row, const std::string& field) {
    return fmt::format("{:.6f}", std::stod(field) + 3 * std::sin(7.0 * static_cast<double>(row)));
  });
  expect_refused({"train", "--cell", cell_, "--batch", spoilt, "--from", model, "--bias", "none",
                  "-o", file("out")},
                 {"nothing known explains it", "train without --from"});
}

TEST_F(CommandLine, ADiagnosisWithoutNextPosesSaysWhyAndWritesNoPlan) {
  const Finished finished = must({"diagnose", "--cell", cell_, "--batch", measure("good", 60, 1),
                                  "--next-poses", file("next.csv")});
  EXPECT_NE(finished.err.find("no poses are suggested: no cause that was found is in doubt"),
            std::string::npos)
      << finished.err;
  EXPECT_FALSE(std::filesystem::exists(file("next.csv")));
}

TEST_F(CommandLine, ADiagnosisIsNotBegunWhereItsResultsCouldNotBeKept) {
  const std::string batch = measure("good", 40, 1);
  const std::string measured = test::read_file(batch);
  const auto wrong = [&](const std::vector<std::string>& more, int exit_code,
                         const std::string& said) {
    std::vector<std::string> all = {"diagnose", "--cell", cell_, "--batch", batch};
    all.insert(all.end(), more.begin(), more.end());
    const Finished finished = trammel(all);
    EXPECT_EQ(finished.exit_code, exit_code) << finished.err;
    EXPECT_NE(finished.err.find(said), std::string::npos) << finished.err;
    const bool tells_a_program = std::find(more.begin(), more.end(), "-") != more.end();
    EXPECT_EQ(finished.out.empty(), !tells_a_program) << finished.out;
    if (tells_a_program) {
      EXPECT_EQ(nlohmann::json::parse(finished.out).at("error").at("code"), "usage");
    }
  };
  wrong({"--json", "-", "--report", "-"}, kWrongUsage, "both go to standard output");
  wrong({"--json", file("a"), "--report", file("a")}, kWrongUsage,
        "--report and --json both go to");
  wrong({"--report", batch}, kWrongUsage, "would overwrite --batch");
  wrong({"--report", cell_, "--apply", "--cell-out", file("cell.yaml")}, kWrongUsage,
        "would overwrite --cell");
  wrong({"--report", file("no/folder/page.html")}, kRefusedData, "cannot be written");
  wrong({"--apply", "--cell-out", file("out.yaml"), "--model", file("no/folder/m")}, kRefusedData,
        "cannot be written");
  for (const char* seed : {"-1", "1.5", "x", ""}) wrong({"--seed", seed}, kWrongUsage, "--seed");
  EXPECT_EQ(test::read_file(batch), measured);
}

TEST_F(CommandLine, AServiceThatIsNotThereEndsWith4) {
  for (const std::vector<std::string>& command : {std::vector<std::string>{"status"},
                                                  {"models", "--cell", "cell-7"},
                                                  {"rollback", "--cell", "cell-7"}}) {
    std::vector<std::string> arguments = command;
    arguments.insert(arguments.end(),
                     {"--service", "--domain", "99", "--port", "19999", "--timeout", "0.3"});
    EXPECT_EQ(trammel(arguments).exit_code, kNoService) << command.front();
  }
}

/// The program against a daemon of its own.
class CommandLineWithService : public CommandLine {
 protected:
  void SetUp() override { daemon_.start(); }
  Finished ask(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(),
                     {"--service", "--domain", std::to_string(daemon_.domain()), "--port",
                      std::to_string(daemon_.port()), "--timeout", "20"});
    return trammel(arguments);
  }
  Finished must_answer(const std::vector<std::string>& arguments) {
    Finished finished = ask(arguments);
    EXPECT_EQ(finished.exit_code, 0) << arguments.front() << ": " << finished.err;
    return finished;
  }
  /// The version that the model file became.
  int imported(const std::string& model) {
    return json::parse(
               must_answer({"import", "--cell", "cell-7", "--model", model, "--json", "-"}).out)
        .at("version");
  }
  test::Daemon daemon_;
};

TEST_F(CommandLineWithService, ASubmittedBatchIsTrainedListedExportedAndAnswersAsTheFileDoes) {
  const std::string batch = measure("first", 40, 1);
  const Finished submitted =
      must_answer({"submit", "--cell", cell_, "--batch", batch, "--watch", "--json", "-"});
  const json made = json::parse(submitted.out);
  EXPECT_EQ(made.at("stage"), "done");
  EXPECT_EQ(codes_of(made.at("notes")).back(), "robot_not_confirmed");

  const json status = json::parse(must_answer({"status", "--json", "-"}).out);
  EXPECT_EQ(status.at("servers").size(), 1u);
  EXPECT_EQ(status.at("models").at(0).at("cell"), "cell-7");
  EXPECT_EQ(status.at("models").at(0).at("notes"), made.at("notes"));
  const json models =
      json::parse(must_answer({"models", "--cell", "cell-7", "--json", "-"}).out).at("models");
  ASSERT_EQ(models.size(), 1u);
  EXPECT_EQ(models.at(0).at("batch"), "first");
  EXPECT_EQ(models.at(0).at("in_force"), true);

  must_answer({"export", "--model", "cell-7", "-o", file("served.model")});
  must({"predict", "--model", file("served.model"), "--joints", batch, "-o", file("here.csv")});
  const Finished predicted = must_answer({"predict", "--model", "cell-7@1", "--joints", batch, "-o",
                                          file("there.csv"), "--json", "-"});
  EXPECT_EQ(test::read_file(file("there.csv")), test::read_file(file("here.csv")));
  EXPECT_EQ(json::parse(predicted.out).at("notes"), made.at("notes"));
  must({"correct", "--model", file("served.model"), file("first-plan.csv"), "-o", file("here.csv"),
        "--allow-failed"});
  must_answer({"correct", "--model", "cell-7", file("first-plan.csv"), "-o", file("there.csv"),
               "--allow-failed"});
  EXPECT_EQ(test::read_file(file("there.csv")), test::read_file(file("here.csv")));
}

TEST_F(CommandLineWithService, AProgramIsTheSameBytesFromAFileFromAPipeAndFromAService) {
  const std::string model = train(measure("first", 40, 1), "M3");
  const int version = imported(model);
  must_answer({"activate", "--model", fmt::format("cell-7@{}", version)});
  const std::string program = TRAMMEL_SOURCE_DIR "/config/programs/drill.mod";
  must({"correct", "--model", model, program, "-o", file("here.mod"), "--receipt",
        file("here.csv")});
  must_answer({"correct", "--model", "cell-7", program, "-o", file("there.mod"), "--receipt",
               file("there.csv")});
  EXPECT_EQ(test::read_file(file("there.mod")), test::read_file(file("here.mod")));
  EXPECT_EQ(test::read_file(file("there.csv")), test::read_file(file("here.csv")));
  const Finished piped =
      test::run({"/bin/sh", "-c",
                 fmt::format("{}/clients/trammel correct --model {} --format rapid - -o - < {}",
                             TRAMMEL_BINARY_DIR, model, program)});
  EXPECT_EQ(piped.exit_code, 0) << piped.err;
  EXPECT_EQ(piped.out, test::read_file(file("here.mod")));
}

TEST_F(CommandLineWithService, VersionsAreRetrainedActivatedRolledBackAndImported) {
  must_answer({"submit", "--cell", "cell-7", "--batch", measure("first", 40, 1), "--id", "lt-01",
               "--watch"});
  const Finished worse = ask({"retrain", "--cell", "cell-7", "--batch", "lt-01", "--level", "M1",
                              "--bias", "none", "--watch"});
  EXPECT_EQ(worse.exit_code, kNotAll) << worse.err;
  for (const char* part :
       {"version 2, not in force", "held-out rms", "trammel activate cell-7@2"}) {
    EXPECT_NE(worse.out.find(part), std::string::npos) << part << " is not in:\n" << worse.out;
  }
  const Finished refused = ask({"activate", "--model", "cell-7@2"});
  EXPECT_EQ(refused.exit_code, kRefusedData);
  EXPECT_NE(refused.err.find("is worse than version 1, which is in force"), std::string::npos)
      << refused.err;
  const Finished activated = must_answer({"activate", "--model", "cell-7@2", "--force"});
  for (const char* part : {"version 2 in force", "held-out rms: before", "the newest is lt-01",
                           "next: trammel rollback --service --cell cell-7 puts version 1"}) {
    EXPECT_NE(activated.out.find(part), std::string::npos) << part << " is not in:\n"
                                                           << activated.out;
  }
  const Finished late = ask({"rollback", "--cell", "cell-7", "--expected", "1"});
  EXPECT_EQ(late.exit_code, kRefusedData);
  EXPECT_NE(late.err.find("version 2 is in force, not 1 as expected"), std::string::npos)
      << late.err;
  EXPECT_NE(must_answer({"rollback", "--cell", "cell-7", "--expected", "2"})
                .out.find("version 1 in force"),
            std::string::npos);
  must_answer({"export", "--model", "cell-7@2", "-o", file("second.model")});
  EXPECT_EQ(imported(file("second.model")), 2) << "the service has it already";
  EXPECT_EQ(imported(train(measure("other", 30, 3), "M1")), 3);
  EXPECT_EQ(ask({"release", "--cell", "cell-7", "--batch", "lt-01", "--expected", "2"}).exit_code,
            kRefusedData);
  EXPECT_EQ(ask({"discard", "--cell", "cell-7", "--batch", "lt-01", "--expected", "2"}).exit_code,
            kRefusedData);
  must_answer({"discard", "--cell", "cell-7", "--batch", "lt-01"});
}

TEST_F(CommandLineWithService, ACheckIsAnsweredThereAsOnFilesAndTheServiceKeepsWhatItSaid) {
  must_answer({"submit", "--cell", "cell-7", "--batch", measure("first", 120, 1), "--watch"});
  EXPECT_NE(must_answer({"check", "--model", "cell-7"}).out.find("was not checked yet"),
            std::string::npos);
  must({"plan", "--cell", cell_, "--check", "12", "-o", file("check-plan.csv")});
  must({"simulate", "--cell", cell_, "--truth", kTruth, "--plan", file("check-plan.csv"), "--seed",
        "5", "-o", file("few.csv")});
  must_answer({"export", "--model", "cell-7", "-o", file("served.model")});
  must({"check", "--model", file("served.model"), "--batch", file("few.csv"), "--json",
        file("here.json")});
  must_answer(
      {"check", "--model", "cell-7", "--batch", file("few.csv"), "--json", file("there.json")});
  const json here = json::parse(test::read_file(file("here.json")));
  const json there = json::parse(test::read_file(file("there.json")));
  for (const char* key :
       {"verdict", "rms_mm", "expected_rms_mm", "would_have_seen_mm", "model", "changed", "why"})
    EXPECT_EQ(there.at(key), here.at(key)) << key;
  const json known =
      json::parse(must_answer({"check", "--model", "cell-7", "--json", "-"}).out).at("cells").at(0);
  EXPECT_EQ(known.at("cell"), "cell-7");
  EXPECT_EQ(known.at("verdict"), here.at("verdict"));
  EXPECT_EQ(known.at("due_because"), there.at("due_because"));
  ASSERT_EQ(known.at("checks").size(), 1u);
  EXPECT_EQ(known["checks"][0]["would_have_seen_mm"], here.at("would_have_seen_mm"));
  EXPECT_EQ(known.at("in_force").at("version"), 1);
  EXPECT_TRUE(known["in_force"]["after_mm"].is_number()) << "as its training was judged";
  const json status = json::parse(must_answer({"status", "--json", "-"}).out);
  EXPECT_EQ(status.at("health").at(0).at("verdict"), here.at("verdict"));
  EXPECT_EQ(status.at("record").at("kind"), "sqlite");
  EXPECT_TRUE(status.at("record").at("reachable"));
  EXPECT_TRUE(status.at("servers").at(0).at("trains"));
  EXPECT_NE(
      must_answer({"status"}).out.find("cell cell-7: " + here.at("verdict").get<std::string>()),
      std::string::npos);
  EXPECT_EQ(trammel({"check", "--model", file("served.model")}).exit_code, kWrongUsage);
}

TEST_F(CommandLineWithService, AnActivatedImportSaysItsFiguresAndTheServiceKeepsThem) {
  must_answer({"submit", "--cell", "cell-7", "--batch", measure("first", 120, 1), "--watch"});
  const int version = imported(train(measure("other", 30, 3), "M1"));
  const std::string model = fmt::format("cell-7@{}", version);
  const Finished refused = ask({"activate", "--model", model});
  EXPECT_EQ(refused.exit_code, kRefusedData);
  for (const char* part : {"is worse than version 1", "mm before (version 1)",
                           "--force puts it in force all the same"})
    EXPECT_NE(refused.err.find(part), std::string::npos) << part << " is not in:\n" << refused.err;
  const json now = json::parse(
      must_answer({"activate", "--model", model, "--force", "--reason", "a trial", "--json", "-"})
          .out);
  ASSERT_TRUE(now.at("before_mm").is_number() && now.at("after_mm").is_number()) << now.dump();
  EXPECT_GT(now.at("after_mm").get<double>(), now.at("before_mm").get<double>());
  EXPECT_NE(now.at("next").get<std::string>().find("trammel rollback"), std::string::npos);
  const json known =
      json::parse(must_answer({"check", "--model", "cell-7", "--json", "-"}).out).at("cells").at(0);
  EXPECT_EQ(known.at("in_force").at("after_mm"), now.at("after_mm"));
  const json trail = json::parse(must_answer({"audit", "--cell", "cell-7", "--json", "-"}).out);
  EXPECT_NE(trail.dump().find("a trial; "), std::string::npos)
      << "the figures stand in the trail, too";
}

TEST_F(CommandLineWithService, WhatCameFromCamIsReplayedWithACandidateBeforeAnybodyActivatesIt) {
  must_answer({"submit", "--cell", "cell-7", "--batch", measure("first", 60, 1), "--watch"});
  const int version = imported(train(measure("other", 30, 3), "M1"));
  must({"plan", "--cell", cell_, "--count", "40", "--seed", "8", "-o", file("work.csv")});
  must_answer(
      {"predict", "--model", "cell-7", "--joints", file("work.csv"), "-o", file("predicted.csv")});
  const std::string candidate = fmt::format("cell-7@{}", version);
  const json asked = json::parse(must_answer({"replay", "--model", candidate, "--json", "-"}).out);
  EXPECT_GE(asked.at("poses"), 16) << "the last ones of a request stand for it";
  EXPECT_EQ(asked.at("in_force").at("version"), 1);
  EXPECT_GT(asked.at("difference").at("max_mm").get<double>(),
            asked.at("difference").at("rms_mm").get<double>());
  const std::string text =
      must_answer({"replay", "--model", candidate, "--next-poses", file("next.csv")}).out;
  EXPECT_NE(text.find("their corrections differ by"), std::string::npos) << text;
  must({"plan", "--cell", cell_, "--from", file("next.csv"), "-o", file("next-plan.csv")});
  EXPECT_EQ(ask({"replay", "--model", "cell-7@99"}).exit_code, kRefusedData);
}

TEST_F(CommandLineWithService, ABatchIsDiagnosedThereAndWhatItNamesPutInForce) {
  must({"plan", "--cell", cell_, "--count", "150", "-o", file("plan.csv")});
  must({"simulate", "--cell", cell_, "--truth", oscillating_truth(folder_), "--plan",
        file("plan.csv"), "-o", file("batch.csv")});
  must_answer({"submit", "--cell", "cell-7", "--batch", file("batch.csv"), "--watch"});
  must_answer({"diagnose", "--cell", "cell-7", "--batch", "batch", "--json", file("found.json"),
               "--report", file("page.html"), "--apply"});
  const json found = json::parse(test::read_file(file("found.json")));
  EXPECT_EQ(found.at("findings").at(0).at("cause"), "gear_transmission");
  EXPECT_TRUE(found.at("applied").at("in_force").get<bool>());
  EXPECT_EQ(found.at("applied").at("version_in_force"), 2);
  EXPECT_NE(found.at("applied").at("outcome").get<std::string>().find("better beyond chance"),
            std::string::npos);
  EXPECT_NE(test::read_file(file("page.html")).find("</html>"), std::string::npos);
  const json models =
      json::parse(must_answer({"models", "--cell", "cell-7", "--json", "-"}).out).at("models");
  EXPECT_NE(models.at(1).at("level").get<std::string>().find("gear_transmission:3"),
            std::string::npos);
}

TEST_F(CommandLineWithService, AnotherToolIsKeptApartShownAndReleased) {
  must_answer({"submit", "--cell", "cell-7", "--batch", measure("first", 60, 1), "--watch"});
  std::string truth = test::read_file(kTruth);
  truth.insert(truth.find("noise:"), "  tool: {tx_mm: 3.0, tz_mm: -2.0}\n");
  must({"plan", "--cell", cell_, "--count", "60", "--seed", "9", "-o", file("plan.csv")});
  must({"simulate", "--cell", cell_, "--truth", folder_.write("tool.yaml", truth), "--plan",
        file("plan.csv"), "-o", file("second.csv")});
  const Finished kept =
      ask({"submit", "--cell", "cell-7", "--batch", file("second.csv"), "--watch"});
  EXPECT_EQ(kept.exit_code, kRefusedData);
  EXPECT_NE(kept.err.find("the tool is another one"), std::string::npos) << kept.err;
  EXPECT_NE(kept.err.find("--release"), std::string::npos) << kept.err;
  const json status = json::parse(must_answer({"status", "--json", "-"}).out);
  EXPECT_EQ(status.at("quarantine").at(0).at("batch"), "second");
  EXPECT_EQ(status.at("jobs").at(1).at("stage"), "failed");
  EXPECT_NE(status.at("jobs").at(1).at("what").get<std::string>().find("the tool is another one"),
            std::string::npos);
  EXPECT_GE(status.at("jobs").at(1).at("finished_unix_s"),
            status.at("jobs").at(0).at("created_unix_s"));
  const std::string shown = must_answer({"status"}).out;
  for (const char* part :
       {"no job runs or waits", "(training of first) done", "(training of second) failed",
        "the tool is another one", "data of", "ended 20"}) {
    EXPECT_NE(shown.find(part), std::string::npos) << part << " is not in:\n" << shown;
  }
  const std::vector<std::string> second = {"retrain", "--cell", "cell-7",
                                           "--batch", "second", "--release"};
  std::vector<std::string> unknown_level = second;
  unknown_level.insert(unknown_level.end(), {"--level", "M9"});
  EXPECT_NE(ask(unknown_level).exit_code, 0);
  EXPECT_EQ(json::parse(must_answer({"status", "--json", "-"}).out).at("quarantine").size(), 1u)
      << "released without a training";
  EXPECT_EQ(ask({"retrain", "--cell", "cell-7", "--batch", "second", "--watch"}).exit_code,
            kRefusedData);
  EXPECT_LE(
      ask({"retrain", "--cell", "cell-7", "--batch", "second", "--release", "--watch"}).exit_code,
      kNotAll);
  EXPECT_TRUE(json::parse(must_answer({"status", "--json", "-"}).out).at("quarantine").empty());
}

TEST_F(CommandLineWithService, AJobIsCancelledAndSaysSoAndOneThatIsOverIsNot) {
  ASSERT_EQ(ask({"submit", "--cell", "cell-7", "--batch",
                 folder_.write("first.csv", test::virtual_batch_csv(60, 1)), "--watch"})
                .exit_code,
            0);
  const Finished over = ask({"cancel", "--job", "1"});
  EXPECT_EQ(over.exit_code, kRefusedData);
  EXPECT_NE(over.err.find("is over"), std::string::npos) << over.err;
  EXPECT_EQ(ask({"cancel", "--job", "77"}).exit_code, kRefusedData);
  // The first takes seconds, the second one waits.
  ASSERT_EQ(ask({"submit", "--cell", "cell-7", "--batch",
                 folder_.write("many.csv", test::virtual_batch_csv(500, 2))})
                .exit_code,
            0);
  ASSERT_EQ(ask({"retrain", "--cell", "cell-7"}).exit_code, 0);
  must_answer({"cancel", "--job", "3"});
  const Finished watched = ask({"watch", "--job", "3"});
  EXPECT_EQ(watched.exit_code, kRefusedData);
  EXPECT_NE(watched.err.find("cancelled by"), std::string::npos) << watched.err;
}

TEST_F(CommandLineWithService, ABatchThatIsNotInQuarantineIsNotSaidToBeReleased) {
  ASSERT_EQ(ask({"submit", "--cell", "cell-7", "--batch",
                 folder_.write("first.csv", test::virtual_batch_csv(60, 1)), "--watch"})
                .exit_code,
            0);
  const Finished released = ask({"release", "--cell", "cell-7", "--batch", "first"});
  EXPECT_EQ(released.exit_code, kRefusedData);
  EXPECT_NE(released.err.find("not in quarantine"), std::string::npos) << released.err;
}

TEST_F(CommandLineWithService, WhatTheServiceRefusesEndsWith3AndItsReason) {
  const Finished unknown = ask({"models", "--cell", "cell-99"});
  EXPECT_EQ(unknown.exit_code, kRefusedData);
  EXPECT_NE(unknown.err.find("cell-99"), std::string::npos) << unknown.err;
  const Finished empty =
      ask({"submit", "--cell", "cell-7", "--batch", folder_.write("empty.csv", "")});
  EXPECT_EQ(empty.exit_code, kRefusedData);
  EXPECT_NE(empty.err.find("empty"), std::string::npos) << empty.err;
}

TEST_F(CommandLine, NoBytesOfAModelFileEndTheProgram) {
  const std::string deep =
      folder_.write("deep.model", R"({"trammel_model":2,"content":)" + std::string(1'000'000, '['));
  const std::string brackets = folder_.write("brackets.model", std::string(30'000'000, '['));
  const std::string batch =
      folder_.write("b.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n");
  for (const std::string& model : {deep, brackets, std::string("/dev/zero")}) {
    expect_refused({"evaluate", "--model", model, "--batch", batch, "--json", "-"},
                   {model, "limit"});
    expect_refused({"report", "--model", model, "-o", file("out")}, {model, "limit"});
  }
  const std::string yaml = folder_.write("deep.yaml", std::string(1'000'000, '['));
  expect_refused({"plan", "--cell", yaml, "--count", "10", "-o", file("out")}, {yaml, "limit"});
  expect_refused({"plan", "--cell", "/dev/zero", "--count", "10", "-o", file("out")},
                 {"/dev/zero", "limit"});
}

TEST_F(CommandLine, EvaluateAndReportWarnOfPosesThatDoNotFitTheModel) {
  const std::string model = train(measure("first", 60, 1), "M2");
  const std::string fresh = measure("fresh", 20, 2);
  const std::string fitting = must({"evaluate", "--model", model, "--batch", fresh}).err;
  EXPECT_EQ(fitting.find("do not fit the model"), std::string::npos) << fitting;
  const CsvTable table = CsvTable::parse(test::read_file(fresh), fresh).value();
  const std::size_t y = table.require("y_mm").value(), x = table.require("x_mm").value();
  std::string text = fmt::format("{}\n", fmt::join(table.columns(), ","));
  for (std::size_t row = 0; row < table.size(); ++row) {
    for (std::size_t k = 0; k < table.columns().size(); ++k)
      text += (k == 0 ? "" : ",") + std::string(table.field(row, k == x ? y : k == y ? x : k));
    text += "\n";
  }
  const std::string exchanged = folder_.write("exchanged.csv", text);
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{"evaluate", "--json", "-"}, {"report", "-o", file("page.html")}}) {
    std::vector<std::string> words = more;
    words.insert(words.begin() + 1, {"--model", model, "--batch", exchanged});
    const Finished warned = must(words);
    EXPECT_NE(warned.err.find("warning: these poses do not fit the model"), std::string::npos)
        << warned.err;
  }
  EXPECT_NE(test::read_file(file("page.html")).find("Nothing can be promised"), std::string::npos);
}

TEST_F(CommandLine, APlannedCheckSaysThatItCountsTheInstrumentsNoiseAlone) {
  const Finished planned =
      must({"plan", "--cell", cell_, "--check", "12", "-o", file("check.csv")});
  EXPECT_NE(planned.out.find("Counting the instrument's noise alone"), std::string::npos)
      << planned.out;
  EXPECT_NE(planned.out.find("trammel check says how large"), std::string::npos) << planned.out;
}

}  // namespace
}  // namespace trammel
