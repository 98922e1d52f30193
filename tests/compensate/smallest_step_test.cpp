#include "server/robot/smallest_step.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/compensate/accuracy.h"
#include "server/compensate/compensated_model.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

constexpr double kRepeatabilityMm = 2;

/// The shipped cell with more in its robot file.
Cell cell_with(const std::string& of_robot) {
  const std::string robot =
      test::demand(read_text_file(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml"));
  const std::string cell = test::demand(read_text_file(TRAMMEL_SOURCE_DIR "/config/cell-7.yaml"));
  return test::demand(parse_cell(cell, robot + of_robot, "c.yaml"));
}

CompensatedModel model_with(const std::string& of_robot) {
  return test::nominal_model(std::make_shared<const Cell>(cell_with(of_robot)), 10);
}

/// The same, which knows its base to 0.1 mm alone.
CompensatedModel unsure_model_with(const std::string& of_robot) {
  CompensatedModel::Parts parts = model_with(of_robot).parts();
  parts.physics = test::demand(make_physical_model(parts.physics.cell, {"base"}));
  for (const Parameter& parameter : parts.physics.parameters())
    parts.parameters.push_back({parameter, 0, 1e-4, true});
  const auto count = static_cast<Eigen::Index>(parts.parameters.size());
  parts.physics.values = Eigen::VectorXd::Zero(count);
  parts.covariance = 1e-8 * Eigen::MatrixXd::Identity(count, count);
  return test::demand(CompensatedModel::make(std::move(parts)));
}

Correction corrected(const CompensatedModel& model) {
  Target target;
  target.joint_target = true;
  target.seed = JointVector::LinSpaced(6, -0.4, 0.5);
  const auto& [tool, payload] = *model.parts().trained_with.begin();
  return model.correct(target, tool, payload);
}

TEST(SmallestStep, NothingIsPromisedBelowTheRepeatabilityOfTheArm) {
  const std::string told = "repeatability_mm: 2\n";
  const Correction fine = corrected(model_with("")), coarse = corrected(model_with(told));
  ASSERT_LT(to_mm(fine.error_after), 0.5 * kRepeatabilityMm) << "the model alone tells less";
  EXPECT_GE(kRadiusOfRms * to_mm(coarse.error_after), kRepeatabilityMm - 1e-9);
  EXPECT_GE(kRadiusOfRms * to_mm(coarse.stddev) * std::sqrt(3.0), kRepeatabilityMm - 1e-9);
  EXPECT_EQ(fine.message, "");
  EXPECT_NE(coarse.message.find("below resolution"), std::string::npos) << coarse.message;
  EXPECT_EQ(coarse.status, fine.status);
  EXPECT_LT((coarse.X_BT_commanded.translation() - fine.X_BT_commanded.translation()).norm(), 1e-9)
      << "what is commanded does not depend on it";

  const PositionAccuracy accuracy = PositionAccuracy::of(model_with(told)).value();
  EXPECT_GE(to_mm(accuracy.at(0.95)), kRepeatabilityMm);
  EXPECT_GE(to_mm(accuracy.at(0.05)), kRepeatabilityMm) << "no share at all is told nearer";
  EXPECT_GE(to_mm(accuracy.least()), kRepeatabilityMm);
  EXPECT_EQ(accuracy.within(from_mm(0.05)), 0);
}

TEST(SmallestStep, RepeatsByIso9283HoldWhatIsPromisedAndAreNotToldAsWorseThanTheyAre) {
  constexpr int kRepeats = 20000;
  std::mt19937_64 random(9283);
  std::normal_distribution<double> normal;
  std::vector<double> lengths;
  for (int k = 0; k < kRepeats; ++k)
    lengths.push_back(Vector3(normal(random), normal(random), normal(random)).norm());
  const auto of = [&](auto f) {
    double sum = 0;
    for (const double length : lengths) sum += f(length);
    return sum / kRepeats;
  };
  const double mean = of([](double l) { return l; });
  const double rms = std::sqrt(of([](double l) { return l * l; }));
  const double repeatability = mean + 3 * std::sqrt(rms * rms - mean * mean);
  EXPECT_NEAR(repeatability, 3.6, 0.05) << "deviations of a coordinate";
  EXPECT_GE(of([&](double l) { return l <= repeatability ? 1 : 0; }), 0.95);
  const double told = repeatability / kRadiusOfRms;
  EXPECT_GE(told, rms) << "no arm is told to be better than its repeats";
  EXPECT_LT(told, 1.4 * rms);
  EXPECT_NEAR(of([&](double l) { return l * told / rms <= repeatability ? 1 : 0; }), 0.95, 0.005)
      << "95 % of what is told reach to RP";
}

TEST(SmallestStep, AnArmThatRepeatsBetterThanItsModelIsToldAsBefore) {
  const Correction before = corrected(unsure_model_with("")),
                   after = corrected(unsure_model_with("repeatability_mm: 0.05\n"));
  ASSERT_GT(to_mm(before.stddev), 0.05);
  EXPECT_EQ(after.error_after, before.error_after);
  EXPECT_EQ(after.message, "");
}

TEST(SmallestStep, EncodersLeaveOpenTheirStepTimesTheLever) {
  std::vector<Joint> joints(2);
  joints[0].link.a = 1;
  joints[1].link.a = 0.5;
  const Chain arm = test::demand(Chain::make("planar", joints));
  const Vector3 p_F = Vector3::Zero();
  ArmSteps steps{0, {1e-3, 0}};
  const double at_lever_1 = kRadiusOfRms * 1e-3 / std::sqrt(12.0);
  EXPECT_NEAR(steps.smallest(arm, JointVector::Zero(2), p_F), 1.5 * at_lever_1, 1e-12);
  JointVector folded(2);
  folded << 0.3, kPi;
  EXPECT_NEAR(steps.smallest(arm, folded, p_F), 0.5 * at_lever_1, 1e-12);
  steps.repeatability = 1e-2;
  EXPECT_EQ(steps.smallest(arm, folded, p_F), 1e-2);
  EXPECT_EQ(ArmSteps().smallest(arm, folded, p_F), 0);
}

TEST(SmallestStep, StepsThatNoArmHasAreRefused) {
  const std::string cell =
      test::demand(read_text_file(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml"));
  for (const char* wrong : {"0", "-0.05", "1000"}) {
    EXPECT_FALSE(parse_robot(cell + "repeatability_mm: " + wrong + "\n", "r.yaml")) << wrong;
  }
}

}  // namespace
}  // namespace trammel
