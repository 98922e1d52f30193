#include "server/diagnose/evidence/bounds.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnose/diagnose.h"
#include "tests/support/demand.h"
#include "tests/support/quick_diagnosis.h"
#include "tests/support/virtual_robot.h"

// The sign of its numbers is part of a cause's name.

namespace trammel::cause_search {
namespace {

/// cell-7's virtual robot, pose after pose with their times. `further`: what it does besides, as it
/// moves from one pose to the next, each source with its numbers.
MeasurementBatch with_moves(const std::vector<std::pair<std::string, std::vector<double>>>& further,
                            int poses, std::uint64_t seed) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  for (const auto& [source, values] : further) {
    const Eigen::Index first =
        add_source(robot.truth, test::demand(make_error_source(source, *cell)));
    for (std::size_t k = 0; k < values.size(); ++k)
      robot.truth.values(first + static_cast<Eigen::Index>(k)) = values[k];
  }
  MeasurementBatch batch = test::measured(robot, poses, seed);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    Measurement& m = batch.measurements[i];
    const PoseContext still = m.context;
    m.context.time = 20.0 * static_cast<double>(i);
    if (i > 0) m.context.before = batch.measurements[i - 1].context.q;
    m.context.direction.assign(6, 0);
    for (Eigen::Index j = 0; i > 0 && j < 6; ++j)
      m.context.direction[static_cast<std::size_t>(j)] =
          m.context.q(j) > (*m.context.before)(j) ? 1 : -1;
    const Pose moved = robot.truth.pose_W(m.context) * robot.truth.pose_W(still).inverse();
    m.p_W = moved * m.p_W;
    m.R_WT = moved.linear() * *m.R_WT;
  }
  return batch;
}

Diagnosis diagnosed(const std::vector<std::pair<std::string, std::vector<double>>>& further,
                    std::uint64_t seed) {
  return test::demand(diagnose(test::cell_7(), with_moves(further, 140, seed), test::quick()));
}

bool names(const Diagnosis& diagnosis, std::string_view cause) {
  return std::any_of(diagnosis.findings.begin(), diagnosis.findings.end(),
                     [&](const Finding& finding) { return finding.cause.cause == cause; });
}

bool holds(const std::vector<std::string>& list, std::string_view word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

constexpr double kTooShort = 60e-6;  // of each move

TEST(Bounds, JointsThatStillLackAShareOfTheirMoveAreReadTooEarly) {
  const Diagnosis early =
      diagnosed({{"early_reading", {kTooShort, kTooShort, kTooShort, 0, 0, 0}}}, 1);
  EXPECT_TRUE(names(early, "early_reading")) << early.sentence;
  EXPECT_FALSE(early.unexplained.present) << early.sentence;
}

TEST(Bounds, JointsThatGoTooFarAreNotAndNobodyIsToldToWaitLonger) {
  const Diagnosis beyond =
      diagnosed({{"early_reading", {-kTooShort, -kTooShort, -kTooShort, 0, 0, 0}}}, 2);
  EXPECT_FALSE(names(beyond, "early_reading")) << beyond.sentence;
  EXPECT_TRUE(beyond.unexplained.present) << beyond.sentence;
  EXPECT_TRUE(holds(beyond.unexplained.depends_on, "dir1")) << beyond.sentence;
  for (const Finding& finding : beyond.findings)
    EXPECT_FALSE(finding.could_also_be.empty()) << beyond.sentence;
  EXPECT_EQ(beyond.sentence.find("wait longer"), std::string::npos) << beyond.sentence;
  EXPECT_NE(beyond.sentence.find("a sign that this cannot have"), std::string::npos)
      << beyond.sentence;
  for (const std::string& source : beyond.sources_after)
    EXPECT_FALSE(source.starts_with("early_reading")) << source;
}

TEST(Bounds, FrictionThatTakesAJointFartherThanItWasSentIsNoHysteresis) {
  const Diagnosis held = diagnosed({{"hysteresis:3", {1.2e-4, 0.02}}}, 3);
  EXPECT_TRUE(names(held, "hysteresis") || names(held, "backlash")) << held.sentence;
  const Diagnosis beyond = diagnosed({{"hysteresis:3", {-1.2e-4, 0.02}}}, 3);
  EXPECT_FALSE(names(beyond, "hysteresis")) << beyond.sentence;
  EXPECT_FALSE(names(beyond, "early_reading")) << beyond.sentence;
  EXPECT_TRUE(beyond.unexplained.present) << beyond.sentence;
}

TEST(Bounds, BesideFrictionNothingHasAWrongSign) {
  for (const std::uint64_t seed : {4, 5}) {
    const Diagnosis found =
        diagnosed({{"hysteresis:2", {1.5e-4, 0.3}},
                   {"early_reading", {0, 0, -kTooShort, -kTooShort, -kTooShort, 0}}},
                  seed);
    EXPECT_FALSE(names(found, "early_reading")) << found.sentence;
    for (const Finding& finding : found.findings) {
      for (const Estimate& one : finding.parameters) {
        if (one.name.starts_with("hyst")) {
          EXPECT_GT(one.value, -one.u95) << found.sentence;
        }
      }
    }
  }
}

TEST(Bounds, WhatIsLostToABoundIsMeasuredAgainstWhatTheCauseExplains) {
  const std::vector<Estimate> one = {{"hyst3", "rad", -1e-4, 1e-5}};
  EXPECT_TRUE((WrongSign{{}, one, {}, 100, 100}.is_another_cause()));
  EXPECT_FALSE((WrongSign{{}, one, {}, 100, 2}.is_beyond_chance())) << "1.4 standard deviations";
  EXPECT_FALSE((WrongSign{{}, one, {}, 5000, 50}.is_beyond_chance()))
      << "no cause has exactly its shape";
  EXPECT_TRUE((WrongSign{{}, one, {}, 100, 30}.is_beyond_chance()));
  EXPECT_FALSE((WrongSign{{}, one, {}, 100, 30}.is_another_cause()));
}

}  // namespace
}  // namespace trammel::cause_search
