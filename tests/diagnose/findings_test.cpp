#include "server/diagnose/tell/findings.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"

namespace trammel {
namespace {

TEST(FindingOfAJointMap, SaysHowMuchTheAngleIsOffFromPeakToPeak) {
  DiagnoseOptions options;
  options.draws = 200;
  options.next_poses = 0;
  options.recovery = false;
  const hidden::HiddenCase hidden =
      hidden::hide({.kind = "joint_map", .seed = 3, .lambda = 3000, .poses = 160});
  const hidden::Effect& effect = hidden.world.effects.at(0);
  const auto joint = static_cast<Eigen::Index>(effect.cause.joint - 1);
  double low = 1;
  double high = -1;
  for (const hidden::MeasuringPose& pose : hidden.world.poses) {
    hidden::Moment moment;
    moment.arm = hidden.world.arm;
    moment.q = pose.q;
    effect.act(pose, effect.values, moment);
    low = std::min(low, 1e6 * (moment.q(joint) - pose.q(joint)));
    high = std::max(high, 1e6 * (moment.q(joint) - pose.q(joint)));
  }
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, options));
  ASSERT_EQ(diagnosis.findings.size(), 1U) << test::told(diagnosis);
  ASSERT_EQ(diagnosis.findings[0].parameters.size(), 1U) << test::told(diagnosis);
  const Estimate& found = diagnosis.findings[0].parameters[0];
  EXPECT_EQ(found.name + " " + found.unit, "peak_to_peak urad");
  EXPECT_NEAR(found.value, high - low, found.u95) << test::told(diagnosis);
  EXPECT_LT(found.u95, 0.5 * found.value);
}

}  // namespace
}  // namespace trammel
