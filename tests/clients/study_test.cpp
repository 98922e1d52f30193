#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "clients/cli/command_line.h"
#include "clients/cli/text/study_text.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

VirtualRobot shipped_robot() {
  auto cell =
      std::make_shared<const Cell>(read_cell(TRAMMEL_SOURCE_DIR "/config/cell-7.yaml").value());
  return read_virtual_robot(TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml", cell).value();
}

double rms_mm(const Study& study, const std::string& set, const std::string& model) {
  for (const StudyRow& row : study.rows) {
    if (row.set == set && row.model == model) return to_mm(row.figures.rms);
  }
  ADD_FAILURE() << "no row " << set << " " << model;
  return 0;
}

TEST(Study, TheCompleteCalibrationReachesTheNoiseFloorAndTheTruth) {
  const Study study = run_study("cal", shipped_robot(), {}).value();
  EXPECT_NEAR(rms_mm(study, "validation", "M0"), 9.7, 0.4);
  EXPECT_LE(rms_mm(study, "validation", "M3"), 0.0245);
  for (const StudyParameter& parameter : study.parameters) {
    const auto found = parameter.identified.find("M3");
    ASSERT_NE(found, parameter.identified.end()) << parameter.name;
    if (!found->second.identified) continue;
    const Parameter& identified = found->second.parameter;
    EXPECT_NEAR(identified.scale * found->second.value, parameter.truth,
                4 * identified.scale * found->second.stddev)
        << parameter.name;
  }
}

TEST(Study, OneJointIsLearnedDownToTheNoiseOnEveryLevel) {
  const Study study = run_study("1dim", shipped_robot(), {}).value();
  for (const char* model : {"M0+GP", "M1+GP", "M2+GP", "M3+GP"}) {
    EXPECT_LE(rms_mm(study, "validation", model), 0.0240) << model;
  }
}

TEST(Study, SameSeedSameTableAndAnotherSeedAnother) {
  StudyOptions other;
  other.seed = 2;
  const std::string table = study_text(run_study("cal", shipped_robot(), {}).value());
  EXPECT_EQ(table, study_text(run_study("cal", shipped_robot(), {}).value()));
  EXPECT_NE(table, study_text(run_study("cal", shipped_robot(), other).value()));
}

TEST(StudyText, NamesABiasThatWasAskedForAndLeftOut) {
  Study study;
  study.name = "6dim-l";
  study.rows = {{"validation", "M2+GP", 300, 100, {}, Evaluation{}, false},
                {"validation", "M3+GP", 300, 100, {}, Evaluation{}, true}};
  const std::string text = study_text(study);
  EXPECT_EQ(text.find("M3+GP"), std::string::npos) << text;
  EXPECT_NE(text.find("validation                  M3+none"), std::string::npos) << text;
  EXPECT_NE(text.find("validation                  M2+GP"), std::string::npos) << text;
  EXPECT_NE(text.find("+none: no bias was worth it"), std::string::npos) << text;
  EXPECT_EQ(study_json(study)["rows"][1]["bias_left_out"], true);
  EXPECT_EQ(study_json(study)["rows"][1]["model"], "M3+GP");
  EXPECT_FALSE(study_json(study)["rows"][0].contains("bias_left_out"));
}

TEST(StudyCommand, WritesTheSourcesFiguresBesideOurs) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("study.json");
  const std::vector<const char*> argv = {"trammel", "study",  "drilling",  "--seed",
                                         "3",       "--json", path.c_str()};
  ASSERT_EQ(run_command_line(static_cast<int>(argv.size()), argv.data()), 0);
  const auto json = nlohmann::json::parse(read_text_file(path).value());
  EXPECT_EQ(json["study"], "drilling");
  EXPECT_EQ(json["seed"], 3);
  EXPECT_EQ(json["rows"][3]["set"], "validation");
  EXPECT_EQ(json["rows"][3]["model"], "M0+GP");
  EXPECT_EQ(json["rows"][3]["poses"], 35);
  EXPECT_EQ(json["rows"][3]["thesis"]["rms_mm"], 0.108);
  EXPECT_TRUE(json["rows"][3]["ours"]["axis"]["z"].contains("std_mm"));
  ASSERT_EQ(json["holes"].size(), 70u);
  EXPECT_EQ(json["holes"][69]["model"], "M3+GP");
  EXPECT_LT(json["holes"][69]["error_after_mm"], 0.05);
}

TEST(StudyCommand, RefusesAnUnknownStudyAndAMissingCell) {
  const std::vector<const char*> unknown = {"trammel", "study", "7dim"};
  EXPECT_EQ(run_command_line(static_cast<int>(unknown.size()), unknown.data()), 2);
  const std::vector<const char*> missing = {"trammel", "study", "cal", "--cell",
                                            "/no/such/cell.yaml"};
  EXPECT_EQ(run_command_line(static_cast<int>(missing.size()), missing.data()), 3);
}

}  // namespace
}  // namespace trammel::cli
