// Checks without an instrument: the tip meets one spike, wherever it stands, in twelve postures.
#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/health/health_check.h"
#include "tests/support/checked_robot.h"
#include "tests/support/demand.h"
#include "tests/support/gauged_arm.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::CheckedRobot;

constexpr double kMissed = 0.013;  // mm, by which the tip misses the spike, per axis

/// One robot for all tests.
const CheckedRobot& robot_with_a_spike() {
  static const CheckedRobot robot = test::trained_robot({.seed = 3, .poses = 200});
  return robot;
}

/// The real arm, joint `joint` (from 1) off by `zero` rad since the training.
hidden::Arm arm_now(int joint, double zero) {
  const auto& all = hidden::arm_parameters();
  Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(all.size()));
  for (std::size_t k = 0; k < all.size(); ++k)
    if (all[k].name == fmt::format("q{}", joint)) values(static_cast<Eigen::Index>(k)) = zero;
  return hidden::changed(robot_with_a_spike().robot.world.arm, values);
}

/// Twelve contacts of `arm` with a spike at that place from its base, mm.
std::vector<test::GaugeRow> contacts(const hidden::Arm& arm, std::uint64_t seed,
                                     const Eigen::Vector3d& spike_mm = {1700, 200, 900}) {
  const hidden::World& world = robot_with_a_spike().robot.world;
  hidden::Random random(seed * 271 + 3);
  std::vector<test::GaugeRow> rows;
  while (rows.size() < 12) {
    Eigen::Vector3d met = (arm.base * spike_mm.homogeneous()).head<3>();
    for (double& x : met) x += kMissed * hidden::normal(random);
    rows.push_back(
        {test::contact_pose(arm, world, met, random), "spike", "distance_mm", 0, "", {0, 0, 0}});
  }
  return rows;
}

Result<HealthCheck> checked_by(const std::vector<test::GaugeRow>& rows) {
  const CompensatedModel& model = robot_with_a_spike().model;
  const MeasurementBatch batch =
      test::demand(parse_batch_csv(test::gauge_text(rows, kMissed, 1), "spike.csv"));
  return check_health(model, test::demand(check_against_cell(batch, model.cell(), drawn(0, 1))),
                      {});
}

TEST(Contacts, OfOneSpikeShowAZeroThatIsOffByAFifthOfAMilliradian) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const HealthCheck check = test::demand(checked_by(contacts(arm_now(3, 0.2e-3), seed)));
    EXPECT_EQ(check.verdict, HealthVerdict::kChanged) << check.sentence;
  }
}

// The second axis turns only as joint 1 does: where that is nearly one angle, its zero shifts all
// contacts alike, as a spike that stands elsewhere does.
TEST(Contacts, WhereTheyCouldHideAZeroTheyAreNotCalledHealthy) {
  int seen = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const HealthCheck check = test::demand(checked_by(contacts(arm_now(2, 0.2e-3), seed)));
    EXPECT_NE(check.verdict, HealthVerdict::kHealthy) << check.sentence;
    seen += check.verdict == HealthVerdict::kChanged;
    if (check.verdict == HealthVerdict::kCannotTell) {
      EXPECT_EQ(in_words(check.smallest.front().cause), "lost zero in joint 2") << check.sentence;
    }
  }
  EXPECT_GE(seen, 3);
}

TEST(Contacts, OfARobotThatIsAsItWasShowNoChange) {
  for (std::uint64_t seed = 11; seed <= 16; ++seed) {
    const HealthCheck check = test::demand(checked_by(contacts(arm_now(2, 0), seed)));
    EXPECT_NE(check.verdict, HealthVerdict::kChanged) << check.sentence;
    EXPECT_EQ(check.poses, 12);
  }
}

TEST(Contacts, DoNotShowTheZeroOfTheFirstJointBecauseTheSpikeMayStandAnywhere) {
  const HealthCheck check = test::demand(checked_by(contacts(arm_now(1, 2e-3), 21)));
  EXPECT_NE(check.verdict, HealthVerdict::kChanged) << check.sentence;
}

TEST(Contacts, WithTwoSpikesAreCheckedOneByOne) {
  std::vector<test::GaugeRow> rows = contacts(arm_now(2, 0), 31);
  rows.back().anchor = "other";
  EXPECT_EQ(test::refusal_of(checked_by(rows)), test::Refusal("spike.csv", 2, "distance_mm"));
}

}  // namespace
}  // namespace trammel
