#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnose/diagnose.h"
#include "server/error_sources/catalogue.h"
#include "server/plan/plan.h"
#include "server/report/diagnosis_json.h"
#include "server/report/diagnosis_page.h"
#include "server/simulate/simulate.h"
#include "server/tasks/train/extend.h"
#include "tests/error_sources/hose_pull.h"
#include "tests/support/demand.h"
#include "tests/support/from_rows.h"
#include "tests/support/virtual_robot.h"

// The recipe of server/error_sources/README.md for adding a cause, followed to the letter: one file
// (tests/error_sources/hose_pull.h) and one line that registers it. Nothing else anywhere knows of
// it.

namespace trammel {
namespace {

constexpr int kJoint = 2;  // 0-based

/// A cell that knows base and geometry, and a robot that hangs on its hoses besides.
class TheRecipe : public testing::Test {
 protected:
  TheRecipe() {
    auto cell = std::make_shared<Cell>(*test::cell_7());
    cell->model.error_sources = {"base", "geometry"};
    cell->model.bias = "none";
    cell_ = std::move(cell);
    batch_ = test::with_held_out(
        pulled(test::demand(plan_poses(*cell_, {.count = 160, .seed = 3}))), 0.2, 1);
  }

  /// As a robot measures them that goes elsewhere than it was told: the effect is put in by hand,
  /// not by the cause.
  [[nodiscard]] MeasurementBatch pulled(const Eigen::MatrixXd& told) const {
    Eigen::MatrixXd gone = told;
    gone.col(kJoint).array() += 1.5e-4 * (3 * told.col(kJoint - 1).array()).sin() -
                                0.8e-4 * (3 * told.col(kJoint - 1).array()).cos();
    VirtualRobot robot{test::demand(make_physical_model(cell_, {"base"})), 13e-6, 61e-6, {}};
    robot.truth.values(0) = 1e-3;  // x0
    MeasurementBatch batch = test::demand(simulate(robot, gone, {}));
    for (std::size_t i = 0; i < batch.measurements.size(); ++i)
      batch.measurements[i].context.q = told.row(static_cast<Eigen::Index>(i)).transpose();
    batch.id = "hoses";
    return batch;
  }

  [[nodiscard]] Diagnosis diagnosed() const {
    DiagnoseOptions options;
    options.next_poses = 0;
    options.recovery = false;
    return test::demand(diagnose(cell_, batch_, options));
  }

  std::shared_ptr<const Cell> cell_;
  MeasurementBatch batch_;
};

TEST_F(TheRecipe, OfOneFileAndOneLineIsFoundNamedExplainedAndAddedToTheModel) {
  const AddedCause registered(causes::hose_pull());

  const Diagnosis diagnosis = diagnosed();
  ASSERT_EQ(diagnosis.verdict, Verdict::kNamed) << diagnosis.sentence;
  ASSERT_EQ(diagnosis.findings.size(), 1U) << diagnosis.sentence;
  const Finding& finding = diagnosis.findings.front();
  EXPECT_EQ(to_string(finding.cause), "hose_pull:3");
  EXPECT_EQ(finding.source, "hose_pull:3");
  ASSERT_EQ(finding.parameters.size(), 2U);
  EXPECT_EQ(finding.parameters[0].unit, "rad");
  EXPECT_NEAR(finding.parameters[0].value, 1.5e-4, finding.parameters[0].u95 + 1e-6);
  EXPECT_NEAR(finding.parameters[1].value, -0.8e-4, finding.parameters[1].u95 + 1e-6);

  // People read its plain name and its advice; programs its spelling.
  EXPECT_NE(diagnosis.sentence.find("hose pull in joint 3"), std::string::npos)
      << diagnosis.sentence;
  EXPECT_EQ(finding.action, "give the hoses more slack, or compensate them");
  EXPECT_EQ(diagnosis_json(diagnosis)["findings"][0]["cause"], "hose_pull");
  const std::string page = diagnosis_page(diagnosis, *cell_);
  EXPECT_NE(page.find("hose pull in joint 3"), std::string::npos);
  EXPECT_NE(page.find("Give the hoses more slack, or compensate them."), std::string::npos);

  const Extension extension = test::demand(extend(cell_, batch_, diagnosis, {}));
  EXPECT_EQ(extension.lasting, (std::vector<std::string>{"base", "geometry", "hose_pull:3"}));
  EXPECT_TRUE(extension.gain.beyond_chance()) << to_string(extension.gain);
  EXPECT_LT(extension.after.parts().validation->compensated.rms,
            0.5 * extension.before.parts().validation->compensated.rms);
}

TEST_F(TheRecipe, IsAbsentWhereNobodyRegisteredIt) {
  const Diagnosis diagnosis = diagnosed();
  for (const Finding& finding : diagnosis.findings) EXPECT_NE(finding.source, "hose_pull:3");
  EXPECT_NE(diagnosis.verdict, Verdict::kNothing) << "something is there all the same";
}

TEST_F(TheRecipe, IsAsCompleteAsThoseThatShip) {
  EXPECT_EQ(missing_in(causes::hose_pull()), std::vector<std::string>{});
}

}  // namespace
}  // namespace trammel
