#include "server/compensate/file_doubts.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/compensate/model_notes.h"
#include "server/diagnose/diagnose.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

// A robot file that is not this robot's is told before whatever else is found.

namespace trammel {
namespace {

/// cell-7 with `was` of the robot file written as `is`.
std::shared_ptr<const Cell> cell_with(const std::string& was, const std::string& is) {
  const auto cell = test::cell_7();
  std::string robot = cell->robot_yaml;
  const std::size_t at = robot.find(was);
  EXPECT_NE(at, std::string::npos) << robot;
  robot.replace(at, was.size(), is);
  return std::make_shared<const Cell>(
      test::demand(parse_cell(cell->cell_yaml, robot, "cell.yaml")));
}

VirtualRobot with_value(VirtualRobot robot, const std::string& name, double by) {
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k)
    if (parameters[k].name == name) robot.truth.values(static_cast<Eigen::Index>(k)) += by;
  return robot;
}

Diagnosis diagnosed(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch) {
  DiagnoseOptions options;
  options.draws = 200;
  options.recovery = false;
  options.next_poses = 0;
  return test::demand(diagnose(cell, batch, options));
}

TEST(FileDoubts, ALinkThatIsWrongInTheFileLeadsThoughTheListOfCausesExplainsIt) {
  const MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 80, 5);
  for (const auto& [file, off] :
       {std::pair("a_mm: 1292", "a2 by -1"), std::pair("a_mm: 1275", "a2 by ")}) {
    const auto cell = cell_with("a_mm: 1280", file);
    const Diagnosis found = diagnosed(cell, batch);
    EXPECT_TRUE(found.sentence.starts_with("No robot is so far off its drawing: "))
        << found.sentence;
    EXPECT_NE(found.sentence.find(off), std::string::npos) << found.sentence;
    ASSERT_FALSE(found.notes.empty());
    EXPECT_EQ(found.notes.front().code, kOffDrawing);
    TrainOptions options;
    options.bias = "none";
    const auto stop = stop_of(test::demand(train(cell, batch, options)));
    ASSERT_TRUE(stop);
    EXPECT_EQ(stop->text, found.notes.front().text) << "a training and a diagnosis say it alike";
  }
  const Diagnosis right = diagnosed(test::cell_7(), batch);
  EXPECT_TRUE(right.notes.empty());
  EXPECT_EQ(right.sentence.find("drawing"), std::string::npos) << right.sentence;
}

TEST(FileDoubts, ALinkThatABiasLearnsStopsAModelWithoutGeometry) {
  const MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 80, 5);
  const auto stop_with = [&](const std::shared_ptr<const Cell>& cell, const std::string& level) {
    TrainOptions options;
    options.level = level;
    options.bias = "se";
    return stop_of(test::demand(train(cell, batch, options)));
  };
  const auto wrong = cell_with("a_mm: 1280", "a_mm: 1285");
  const auto stop = stop_with(wrong, "M1");
  ASSERT_TRUE(stop) << "positions fit, and the controller solves corrected poses with its own arm";
  EXPECT_EQ(stop->code, kOffDrawing);
  EXPECT_NE(stop->text.find("a2 by -"), std::string::npos) << stop->text;
  const auto none = stop_with(test::cell_7(), "M1");
  EXPECT_FALSE(none) << none->text;
}

TEST(FileDoubts, OfLostZerosAloneItAsksForMasteringAndLeadsWithTheirMillimetres) {
  const VirtualRobot robot = with_value(test::chapter_5_robot(test::cell_7()), "q4", from_deg(3));
  const Diagnosis found = diagnosed(test::cell_7(), test::measured(robot, 80, 5));
  ASSERT_FALSE(found.notes.empty());
  EXPECT_EQ(found.notes.front().code, kOffDrawing);
  EXPECT_EQ(found.sentence.find("is it this robot's file"), std::string::npos) << found.sentence;
  for (const char* part : {"Zeros are far off: q4 by 2.99 deg", "because of the zero of joint 4",
                           "re-master joint 4", "Beyond that nothing was found in 80 poses"})
    EXPECT_NE(found.sentence.find(part), std::string::npos) << part << "\n" << found.sentence;
}

TEST(FileDoubts, BesideMuchThatIsLeftTheNumberMayMakeUpForSomethingElse) {
  const PhysicalModel model = test::demand(make_physical_model(test::cell_7(), {"geometry"}));
  std::vector<IdentifiedParameter> parameters;
  for (const Parameter& one : model.parameters()) {
    parameters.emplace_back();
    parameters.back().parameter = one;
    parameters.back().value = one.name == "alpha4" ? 5e-3 : 0;
    parameters.back().stddev = 1e-5;
  }
  const double sigma = model.cell->tracker.sigma;
  const auto told = [&](double left) {
    const auto off = robot_off_drawing(model, parameters, left);
    return off ? off->text : "";
  };
  EXPECT_NE(told(0).find("alpha4 by 0.286 deg (limit 0.172); is it this robot's file"),
            std::string::npos)
      << told(0);
  EXPECT_NE(told(10 * sigma).find("10 times the stated sigma is left as well"), std::string::npos)
      << told(10 * sigma);
}

TEST(FileDoubts, AForgottenHayatiRowIsToldAndNoCauseOfItsJointsIsSure) {
  const auto cell = cell_with(", hayati: true", "");
  for (const double tilt : {4e-4, 1.5e-3}) {
    const VirtualRobot robot = with_value(test::chapter_5_robot(test::cell_7()), "beta2", tilt);
    const Diagnosis found = diagnosed(cell, test::measured(robot, 80, 5));
    EXPECT_NE(found.sentence.find("joint 2 of the robot file has no `hayati: true`"),
              std::string::npos)
        << found.sentence;
    ASSERT_FALSE(found.notes.empty());
    EXPECT_EQ(found.notes.back().code, "hayati_missing");
    for (const Finding& finding : found.findings) {
      if (finding.cause.joint != 1 && finding.cause.joint != 2) continue;
      EXPECT_FALSE(finding.could_also_be.empty()) << found.sentence;
    }
  }
}

TEST(RowsThatDoNotFit, AreNamedAsATrainingNamesThemWhereAllTogetherLeadToNoArm) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  MeasurementBatch batch = test::measured(robot, 80, 5);
  // A tracker that did not see the reflector tells where it was last: 30 rows, some behind each
  // other.
  std::vector<int> stale;
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    const std::size_t since = i % 8;
    if (since == 0 || since > 3) continue;
    batch.measurements[i].p_W = batch.measurements[i - since].p_W;
    batch.measurements[i].R_WT = batch.measurements[i - since].R_WT;
    stale.push_back(batch.measurements[i].row);
  }
  const Diagnosis found = diagnosed(test::cell_7(), batch);
  std::vector<int> named;
  for (const SuspectedPose& one : found.suspects) named.push_back(one.row);
  std::sort(named.begin(), named.end());
  EXPECT_EQ(named, stale) << found.sentence;
  ASSERT_FALSE(found.notes.empty()) << found.sentence;
  EXPECT_EQ(found.notes.front().code, "rows_do_not_fit");
  EXPECT_TRUE(found.sentence.starts_with("30 of the measured rows do not fit the others"))
      << found.sentence;
  TrainOptions options;
  options.bias = "none";
  const auto stop = stop_of(test::demand(train(test::cell_7(), batch, options)));
  ASSERT_TRUE(stop);
  EXPECT_EQ(stop->text, found.notes.front().text) << "a training and a diagnosis say it alike";
}

}  // namespace
}  // namespace trammel
