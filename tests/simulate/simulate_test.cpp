#include "server/simulate/simulate.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

TEST(Simulate, TheThesisRobotMissesByAsMuchAsPrinted) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const MeasurementBatch batch = test::measured(robot, 1000, 21);
  double sum = 0;
  for (const Measurement& m : batch.measurements) {
    sum += (m.p_W - robot.truth.nominal_pose_W(m.context).translation()).squaredNorm();
  }
  EXPECT_NEAR(to_mm(std::sqrt(sum / 1000)), 9.7, 0.3);  // Table 5.4, with the physical wrench
}

TEST(Simulate, NoiseIsWhatTheTruthFileSays) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const MeasurementBatch batch = test::measured(robot, 2000, 22);
  double position = 0;
  double rotation = 0;
  for (const Measurement& m : batch.measurements) {
    const Vector6 e = pose_difference(make_pose(*m.R_WT, m.p_W), robot.truth.pose_W(m.context));
    position += e.head<3>().squaredNorm();
    rotation += e.tail<3>().squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(position / 6000), 13e-6, 0.5e-6);
  EXPECT_NEAR(std::sqrt(rotation / 6000), from_deg(0.0035), 0.03 * from_deg(0.0035));
}

TEST(Simulate, SameSeedSameBatch) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  EXPECT_EQ(to_csv(test::measured(robot, 5, 1)), to_csv(test::measured(robot, 5, 1)));
  EXPECT_NE(to_csv(test::measured(robot, 5, 1)), to_csv(test::measured(robot, 5, 2)));
}

TEST(Simulate, RefusesPosesTheRobotCannotTake) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  EXPECT_FALSE(simulate(robot, Eigen::MatrixXd::Zero(1, 5), {}));
  Eigen::MatrixXd q = Eigen::MatrixXd::Zero(2, 6);
  q(1, 2) = from_deg(71);
  const Result<MeasurementBatch> beyond = simulate(robot, q, {});
  ASSERT_FALSE(beyond);
  EXPECT_EQ(refusal_of(beyond), Refusal("", {}, "q3_deg").beyond(71, 70));
}

TEST(TruthFile, RefusesUnknownSourcesParametersAndKeys) {
  const test::TemporaryFolder folder;
  const auto refusal = [&](const std::string& text) {
    const Result<VirtualRobot> read =
        read_virtual_robot(folder.write("truth.yaml", text), test::cell_7());
    EXPECT_FALSE(read) << text;
    return refusal_of(read);
  };
  EXPECT_EQ(refusal("version: 1\nerror_sources: {gremlins: {}}\n"),
            Refusal(folder.file("truth.yaml"), 2, "error_sources").text("gremlins"));
  EXPECT_EQ(refusal("version: 1\nerror_sources: {base: {x0: 1}}\n"),
            Refusal(folder.file("truth.yaml"), 2, "error_sources: base: x0"));
  EXPECT_EQ(refusal("version: 1\nerror_sources: {}\nnoises: {}\n"),
            Refusal(folder.file("truth.yaml"), 3, "noises"));
}

}  // namespace
}  // namespace trammel
