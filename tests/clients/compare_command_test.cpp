#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/cli/command_line.h"
#include "server/base/text_file.h"
#include "tests/support/demand.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

using nlohmann::json;

constexpr double kDegree = 0.017453292519943295;
constexpr double kZero = 5e-3,
                 kZeroBefore = -2.6e-4;  // rad, of joint 4: afterwards, and in the shipped truth

std::string text_of(const std::string& path) { return test::demand(read_text_file(path)); }

int trammel(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "trammel");
  std::vector<const char*> argv;
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  return run_command_line(static_cast<int>(argv.size()), argv.data());
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), by);
}

/// Two models of one robot, whose joint 4 got another zero between them, and one of a robot that is
/// longer.
class Compare : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<test::TemporaryFolder>();
    const std::string shipped = TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml";
    const std::string changed = folder_->write(
        "changed.yaml", replaced(text_of(shipped), "q4_rad: -2.6e-4", "q4_rad: 5e-3"));
    const std::string cell = TRAMMEL_SOURCE_DIR "/config/cell-7.yaml";
    make("before", cell, shipped, 1);
    make("now", cell, changed, 2);
    measure("fresh", cell, changed, 3);
    folder_->write("longer.yaml",
                   replaced(text_of(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml"),
                            "d_mm: 780", "d_mm: 790"));
    make("other",
         folder_->write(
             "other-cell.yaml",
             replaced(text_of(cell), "../models/abb_irb6640-205-275.yaml", "longer.yaml")),
         shipped, 4);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string file(const std::string& name) { return folder_->file(name); }
  static json json_in(const std::string& name) { return json::parse(text_of(file(name))); }
  static void measure(const std::string& name, const std::string& cell, const std::string& truth,
                      int seed) {
    ASSERT_EQ(trammel({"plan", "--cell", cell, "--count", "60", "--seed", std::to_string(seed),
                       "-o", file(name + "-plan.csv")}),
              0);
    ASSERT_EQ(
        trammel({"simulate", "--cell", cell, "--truth", truth, "--plan", file(name + "-plan.csv"),
                 "--seed", std::to_string(seed), "-o", file(name + ".csv")}),
        0);
  }
  static void make(const std::string& name, const std::string& cell, const std::string& truth,
                   int seed) {
    measure(name, cell, truth, seed);
    ASSERT_EQ(trammel({"train", "--cell", cell, "--batch", file(name + ".csv"), "--level", "M3",
                       "--bias", "none", "-o", file(name + ".model")}),
              0);
  }

  static inline std::unique_ptr<test::TemporaryFolder> folder_;
};

TEST_F(Compare, LeadsWithTheZeroThatChanged) {
  ASSERT_EQ(trammel({"compare", file("before.model"), file("now.model"), "--json", file("c.json"),
                     "--report", file("c.html")}),
            0);
  const json told = json_in("c.json");
  EXPECT_EQ(told.at("a").at("cell"), "cell-7");
  EXPECT_EQ(told.at("b").at("batch"), "now");
  EXPECT_GT(told.at("max_mm").get<double>(), told.at("rms_mm").get<double>());
  const json& budget = told.at("budget");
  EXPECT_NEAR(budget.at("nominal_rms_mm").get<double>(), told.at("rms_mm").get<double>(), 1e-9);
  const json& first = budget.at("beyond_frames").at("lines").at(0);
  EXPECT_EQ(first.at("line"), "zero:4");
  EXPECT_EQ(first.at("kind"), "joint_zero");
  EXPECT_EQ(first.at("joint"), 4);
  EXPECT_EQ(first.at("unit"), "deg");
  EXPECT_NEAR(first.at("value").get<double>(), (kZero - kZeroBefore) / kDegree, 0.02);
  EXPECT_GT(first.at("share").get<double>(), 0.9);
  for (const json& one : told.at("parameters")) {
    if (one.at("name") != "q4") continue;
    EXPECT_TRUE(one.at("beyond_u95").get<bool>());
    EXPECT_NEAR(one.at("difference").get<double>(),
                one.at("b").get<double>() - one.at("a").get<double>(), 1e-12);
  }
  EXPECT_EQ(told.at("most_moved").at(0).at("joints").size(), 6u);
  EXPECT_TRUE(told.at("most_moved").at(0).at("joints").contains("q1_deg"));
  EXPECT_EQ(told.at("notes").back().at("code"), "robot_not_confirmed");
  EXPECT_FALSE(told.contains("batch")) << "nothing was measured";
  EXPECT_NE(text_of(file("c.html")).find("the zero of joint 4"), std::string::npos);
}

TEST_F(Compare, MeasurementsSayWhichModelTheRobotIsLike) {
  ASSERT_EQ(trammel({"compare", file("before.model"), file("now.model"), "--batch",
                     file("fresh.csv"), "--json", file("c.json")}),
            0);
  const json told = json_in("c.json");
  EXPECT_EQ(told.at("poses"), 60);
  EXPECT_TRUE(told.at("batch").at("b_is_better").get<bool>());
  EXPECT_LT(told.at("batch").at("b").at("rms_mm").get<double>(), 0.04);
  EXPECT_GT(told.at("batch").at("a").at("rms_mm").get<double>(), 0.5);
  EXPECT_FALSE(told.contains("trained_on"));
}

TEST_F(Compare, APoseThatOneOfThemWasTrainedOnJudgesNeither) {
  ASSERT_EQ(trammel({"compare", file("before.model"), file("now.model"), "--batch", file("now.csv"),
                     "--json", file("c.json")}),
            0);
  const json told = json_in("c.json");
  EXPECT_EQ(told.at("trained_on"), 60);
  EXPECT_FALSE(told.contains("batch"));
}

TEST_F(Compare, AModelOfAnotherRobotIsRefusedWithASentence) {
  testing::internal::CaptureStderr();
  const int code =
      trammel({"compare", file("other.model"), file("now.model"), "--json", file("none.json")});
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(code, 3);
  EXPECT_NE(said.find("was trained for another robot than cell cell-7 has"), std::string::npos)
      << said;
  EXPECT_FALSE(read_text_file(file("none.json")));
}

TEST_F(Compare, ACheckIsNotHealthyWhereAZeroChangedAndStrictlyEndsWithOne) {
  const std::vector<std::string> changed = {"check",       "--model",         file("before.model"),
                                            "--batch",     file("fresh.csv"), "--json",
                                            file("h.json")};
  EXPECT_EQ(trammel(changed), 0);
  const json told = json_in("h.json");
  EXPECT_EQ(told.at("verdict"), "changed");
  EXPECT_EQ(told.at("budget").at("lines").at(0).at("line"), "zero:4");
  EXPECT_NE(told.at("budget").at("sentences").at(0).get<std::string>().find("mm alone"),
            std::string::npos);
  EXPECT_EQ(told.at("notes").back().at("code"), "robot_not_confirmed");
  testing::internal::CaptureStdout();
  trammel({"check", "--model", file("before.model"), "--batch", file("fresh.csv")});
  const std::string said = testing::internal::GetCapturedStdout();
  EXPECT_NE(said.find("what to do: re-master joint 4\n"), std::string::npos) << said;
  EXPECT_EQ(said.find("the zero of joint 4 ("), std::string::npos)
      << "the millimetres of a zero stand there once: " << said;
  std::vector<std::string> strictly = changed;
  strictly.emplace_back("--strict");
  EXPECT_EQ(trammel(strictly), 1);
  EXPECT_EQ(
      trammel({"check", "--model", file("now.model"), "--batch", file("fresh.csv"), "--strict"}),
      0);
}

TEST_F(Compare, ADiagnosisAtAServiceSaysWhyItTakesNoModelFromBeforeARepair) {
  testing::internal::CaptureStderr();
  const int code =
      trammel({"diagnose", "--cell", TRAMMEL_SOURCE_DIR "/config/cell-7.yaml", "--batch",
               file("fresh.csv"), "--since", file("before.model"), "--service"});
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(code, 2);
  for (const char* part : {"a service diagnoses by its own model", "trammel export"})
    EXPECT_NE(said.find(part), std::string::npos) << said;
}

TEST_F(Compare, RemediesTellEachStepWhatItSetsAndWhatItLeaves) {
  ASSERT_EQ(trammel({"remedies", "--model", file("now.model"), "--json", file("r.json"), "-o",
                     file("r.html")}),
            0);
  const json told = json_in("r.json");
  std::vector<std::string> names;
  for (const json& step : told.at("steps")) names.push_back(step.at("step"));
  EXPECT_EQ(names, (std::vector<std::string>{"frames", "zeros", "lengths", "loads", "trammel"}));
  const json& zeros = told.at("steps").at(1);
  EXPECT_LT(zeros.at("left_rms_mm").get<double>(),
            told.at("steps").at(0).at("left_rms_mm").get<double>());
  EXPECT_LT(told.at("steps").at(4).at("left_rms_mm").get<double>(), 0.04);
  bool found = false;
  for (const json& value : zeros.at("values")) {
    if (value.at("name") != "joint 4") continue;
    found = true;
    EXPECT_EQ(value.at("unit"), "deg");
    EXPECT_NEAR(value.at("add").get<double>(), kZero / kDegree, 0.03);
  }
  EXPECT_TRUE(found) << zeros;
  const json& lines = told.at("budget").at("lines");
  for (std::size_t k = 1; k < lines.size(); ++k)
    EXPECT_GE(lines[k - 1].at("alone_rms_mm").get<double>(),
              lines[k].at("alone_rms_mm").get<double>())
        << k;
  EXPECT_EQ(told.at("notes").back().at("code"), "robot_not_confirmed");
}

TEST_F(Compare, AfterARepairDiagnoseSaysOfEachLineWhetherItHelped) {
  const std::string cell = TRAMMEL_SOURCE_DIR "/config/cell-7.yaml";
  measure("repaired", cell, TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml", 6);
  const auto since = [&](const std::string& batch) {
    EXPECT_EQ(trammel({"diagnose", "--cell", cell, "--batch", file(batch + ".csv"), "--since",
                       file("now.model"), "--json", file("d.json"), "--report", file("d.html")}),
              0);
    return json_in("d.json").at("since");
  };
  const auto zero_4 = [](const json& told) {
    for (const json& line : told.at("lines"))
      if (line.at("line") == "zero:4") return line;
    return json();
  };
  const json helped = since("repaired");
  ASSERT_TRUE(zero_4(helped).is_object()) << helped;
  EXPECT_EQ(zero_4(helped).at("helped"), "put_right") << helped;
  EXPECT_NEAR(zero_4(helped).at("moved").at("value").get<double>(), (kZeroBefore - kZero) / kDegree,
              0.03);
  EXPECT_LT(helped.at("now_rms_mm").get<double>(), helped.at("before_rms_mm").get<double>());
  EXPECT_NE(text_of(file("d.html")).find("did it help"), std::string::npos);
  EXPECT_EQ(zero_4(since("fresh")).at("helped"), "not_moved") << "nobody repaired it";
}

TEST_F(Compare, DiagnoseProvesNoLongerThanItMayAndSaysWhatIsOpen) {
  const std::string cell = TRAMMEL_SOURCE_DIR "/config/cell-7.yaml";
  ASSERT_EQ(
      trammel({"diagnose", "--cell", cell, "--batch", file("fresh.csv"), "--prove",
               "--prove-minutes", "0.0001", "--json", file("p.json"), "--report", file("p.html")}),
      0);
  const json proof = json_in("p.json").at("proof");
  ASSERT_GT(proof.at("causes").size(), 10u);
  for (const json& cause : proof.at("causes")) {
    EXPECT_EQ(cause.at("outcome"), "open");
    EXPECT_TRUE(cause.at("sizes").empty()) << "the diagnosis itself took all of the time";
  }
  EXPECT_NE(text_of(file("p.html")).find("proved in these residuals"), std::string::npos);
}

TEST_F(Compare, DiagnoseRefusesToProveWhereItCannot) {
  const std::string cell = TRAMMEL_SOURCE_DIR "/config/cell-7.yaml";
  const std::vector<std::string> on_files = {"diagnose", "--cell", cell, "--batch",
                                             file("fresh.csv")};
  const auto with = [&](std::vector<std::string> arguments, const std::vector<std::string>& more) {
    arguments.insert(arguments.end(), more.begin(), more.end());
    return trammel(arguments);
  };
  EXPECT_EQ(with(on_files, {"--prove-minutes", "1"}), 2) << "minutes for what?";
  EXPECT_EQ(with(on_files, {"--prove", "--prove-minutes", "0"}), 2);
  EXPECT_EQ(trammel({"diagnose", "--service", "--cell", "cell-7", "--prove"}), 2);
}

TEST_F(Compare, RemediesPlanThePosesThatProveThemAfterwards) {
  ASSERT_EQ(trammel({"remedies", "--model", file("now.model"), "--json", file("r.json"),
                     "--check-poses", file("prove.csv")}),
            0);
  const json told = json_in("r.json");
  EXPECT_EQ(told.at("check_poses").at("poses").size(), 30u);
  EXPECT_EQ(told.at("check_poses").at("columns").at(0), "q1_deg");
  EXPECT_EQ(told.at("zeros").at(0).at("axis").get<std::string>().substr(0, 5), "axis ");
  ASSERT_EQ(trammel({"simulate", "--cell", TRAMMEL_SOURCE_DIR "/config/cell-7.yaml", "--truth",
                     TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml", "--plan", file("prove.csv"),
                     "-o", file("proved.csv")}),
            0)
      << "the plan can be measured";
}

TEST_F(Compare, ALoadThatIsAnotherHasALineOfItsOwn) {
  const std::string shipped = TRAMMEL_SOURCE_DIR "/config/cell-7.yaml";
  folder_->write("same.yaml", text_of(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml"));
  const std::string lighter = folder_->write(
      "lighter.yaml",
      replaced(replaced(text_of(shipped), "../models/abb_irb6640-205-275.yaml", "same.yaml"),
               "mass_kg: 100", "mass_kg: 20"));
  make("lighter", lighter, TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml", 7);
  ASSERT_EQ(
      trammel({"compare", file("before.model"), file("lighter.model"), "--json", file("c.json")}),
      0);
  const json told = json_in("c.json");
  const json& first = told.at("budget").at("beyond_frames").at("lines").at(0);
  EXPECT_EQ(first.at("line"), "payload") << told;
  EXPECT_NEAR(first.at("value").get<double>(), 20 - 100, 1e-9);
  EXPECT_EQ(first.at("unit"), "kg");
  EXPECT_GT(first.at("share").get<double>(), 0.8);
}

TEST_F(Compare, APredictedProgramHasTheNotesOfItsModelAsCodes) {
  ASSERT_EQ(trammel({"predict", TRAMMEL_SOURCE_DIR "/config/programs/drill.mod", "--model",
                     file("now.model"), "-o", file("p.csv"), "--json", file("p.json")}),
            0);
  const json told = json_in("p.json");
  std::vector<std::string> codes;
  for (const json& note : told.at("notes")) codes.push_back(note.at("code"));
  EXPECT_NE(std::find(codes.begin(), codes.end(), "robot_not_confirmed"), codes.end());
}

}  // namespace
}  // namespace trammel::cli
