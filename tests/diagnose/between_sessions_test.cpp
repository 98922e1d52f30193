#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnose/diagnose.h"
#include "server/measurement/sessions.h"
#include "server/report/diagnosis_json.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

/// Sessions of 50 poses, the tracker set up anew for each.
Diagnosis diagnosis_of(const std::vector<VirtualRobot>& robots, std::uint64_t seed) {
  const std::shared_ptr<const Cell>& cell = robots.front().truth.cell;
  std::vector<CheckedBatch> batches;
  for (std::size_t s = 0; s < robots.size(); ++s) {
    MeasurementBatch batch =
        test::measured_on(robots[s], {.poses = 50, .seed = seed + 31 * s, .set_up_anew = s + 1 < robots.size()});
    batch.id = fmt::format("day-{}", s + 1);
    batches.push_back(test::demand(check_against_cell(std::move(batch), *cell)));
  }
  DiagnoseOptions options;
  options.recovery = false;
  return test::demand(diagnose(cell, joined(batches), options));
}

TEST(BetweenSessions, AZeroThatWasLostIsToldWithItsSessionAndIsNoNoise) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const VirtualRobot after = test::with_zero_off(robot, 3, 5e-4);
  const Diagnosis good = diagnosis_of({robot, robot, robot}, 20);
  EXPECT_EQ(good.sentence.find("session"), std::string::npos) << good.sentence;
  const Diagnosis diagnosis = diagnosis_of({robot, after, after}, 20);
  const auto found = std::find_if(diagnosis.findings.begin(), diagnosis.findings.end(),
                                  [](const Finding& one) { return one.since_session == "day-2"; });
  ASSERT_NE(found, diagnosis.findings.end()) << diagnosis.sentence;
  EXPECT_EQ(found->cause.joint, 2);
  ASSERT_EQ(diagnosis.between_sessions.size(), 1u);
  const auto json = diagnosis_json(diagnosis).at("between_sessions").at(0);
  EXPECT_EQ(json.at("cause"), "joint_slip");
  EXPECT_EQ(json.at("joint"), 3);
  EXPECT_EQ(json.at("since").at("session_id"), "day-2");
  const auto& zero = json.at("parameters").begin().value();
  EXPECT_NEAR(zero.at("value").get<double>(), 0.5, 2 * zero.at("u95").get<double>());
  EXPECT_EQ(zero.at("unit"), "mrad");
  EXPECT_TRUE(json.at("rests_on_order").get<bool>()) << "no row has a time";
  EXPECT_TRUE(std::any_of(diagnosis.limits.begin(), diagnosis.limits.end(), [](const std::string& limit) {
    return limit.find("in which they were given") != std::string::npos;
  }));
  EXPECT_TRUE(good.between_sessions.empty());
  EXPECT_LT(diagnosis.noise, 1.15 * good.noise);
}

TEST(BetweenSessions, AReflectorThatSatElsewhereForADayIsToldAndIsNoNoise) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  VirtualRobot other = robot;
  other.truth.tools.at("spindle").translation() += Vector3(2e-4, 0, 1e-4);
  const Diagnosis good = diagnosis_of({robot, robot, robot, robot}, 60);
  const Diagnosis diagnosis = diagnosis_of({robot, other, robot, robot}, 60);
  EXPECT_NE(diagnosis.sentence.find("in session day-2 alone"), std::string::npos) << diagnosis.sentence;
  ASSERT_EQ(diagnosis.between_sessions.size(), 1u);
  EXPECT_EQ(diagnosis.between_sessions.front().course, SessionChange::Course::kThatAlone);
  EXPECT_EQ(diagnosis.between_sessions.front().sizes.size(), 6u) << "where it sits, and how it is turned";
  EXPECT_TRUE(diagnosis.findings.empty()) << diagnosis.sentence;
  EXPECT_LT(diagnosis.noise, 1.15 * good.noise);
}

}  // namespace
}  // namespace trammel
