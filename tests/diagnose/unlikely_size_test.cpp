#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnose/diagnose.h"
#include "server/diagnose/tell/doubts.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

// What is larger than robots have it is doubted: the weight of the arm itself does the same.

namespace trammel {
namespace {

bool holds(const std::vector<Cause>& causes, const Cause& cause) {
  return std::find(causes.begin(), causes.end(), cause) != causes.end();
}

TEST(UnlikelySize, AnEncoderOffByMoreThanRobotsHaveItMayBeTheArmsOwnWeight) {
  const auto cell = test::cell_7();
  for (const double amplitude : {2e-4, 1.5e-3}) {
    VirtualRobot robot = test::chapter_5_robot(cell);
    const Eigen::Index at =
        add_source(robot.truth, test::demand(make_error_source("encoder_eccentricity:3", *cell)));
    robot.truth.values(at + 1) = amplitude;
    DiagnoseOptions options;
    options.draws = 200;
    options.recovery = false;
    options.next_poses = 0;
    const Diagnosis found = test::demand(diagnose(cell, test::measured(robot, 120, 7), options));
    ASSERT_EQ(found.findings.size(), 1U) << found.sentence;
    const Finding& finding = found.findings[0];
    EXPECT_EQ(finding.cause, (Cause{.cause = "encoder_eccentricity", .joint = 2}));
    const bool large = amplitude > 1e-3;
    EXPECT_FALSE(holds(finding.could_also_be, {"self_weight"}))
        << "these poses tell: " << found.sentence;
    EXPECT_EQ(holds(finding.could_also_be, {"balancer"}), large) << found.sentence;
    EXPECT_EQ(found.sources_after.size() > found.sources_before.size(), !large);
    EXPECT_EQ(finding.action.find("larger than robots have it") != std::string::npos, large)
        << finding.action;
  }
}

TEST(UnlikelySize, OfAPayloadItsCentreOfGravityTellsAndNotItsMass) {
  using cause_search::is_unlikely;
  EXPECT_FALSE(is_unlikely({"payload"}, Eigen::Vector4d(12, 1, -3, 2)));
  EXPECT_TRUE(is_unlikely({"payload"}, Eigen::Vector4d(0, 1, -11.4, 2)));
  EXPECT_FALSE(
      is_unlikely({.cause = "payload_changed", .pose_id = "p7"}, Eigen::Vector4d(0, 0, 11, 0)));
  EXPECT_FALSE(is_unlikely({.cause = "backlash", .joint = 1}, Eigen::Vector2d(9, 0)));
}

}  // namespace
}  // namespace trammel
