#include "server/compensate/model_guards.h"

#include <gtest/gtest.h>

#include "server/compensate/model_notes.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

constexpr double kAxes = 1.7320508075688772;  // sqrt(3): rms of a position over that of an axis

/// A model of cell-7 that leaves so many times the stated sigma; `discrepancy`: likewise, what single bad poses and
/// the rows' own sigmas do not explain.
CompensatedModel leaving(double sigmas, double discrepancy) {
  CompensatedModel::Parts parts;
  parts.physics = test::demand(make_physical_model(test::cell_7(), {"base"}));
  parts.q_min = JointVector::Constant(6, -1);
  parts.q_max = JointVector::Constant(6, 1);
  for (const Parameter& parameter : parts.physics.parameters()) parts.parameters.push_back({parameter, 0, 0, true});
  const auto P = parts.physics.parameter_count();
  parts.covariance = Eigen::MatrixXd::Zero(P, P);
  const double sigma = test::cell_7()->tracker.sigma;
  parts.training.poses = 60;
  parts.training.compensated.rms = kAxes * sigmas * sigma;
  parts.discrepancy = discrepancy * sigma;
  return test::demand(CompensatedModel::make(std::move(parts)));
}

TEST(ModelGuards, WhatIsLeftIsHeldAgainstTheStatedSigma) {
  EXPECT_TRUE(guards_of(leaving(2.9, 2.9)).empty());
  const std::vector<Note> noted = guards_of(leaving(4, 10));
  ASSERT_EQ(noted.size(), 1U);
  EXPECT_EQ(noted[0].code, "left_beyond_sigma");
  EXPECT_EQ(noted[0].severity, Severity::kLeads);
  const std::vector<Note> held = guards_of(leaving(700, 700));
  ASSERT_EQ(held.size(), 1U);
  EXPECT_EQ(held[0].code, "left_beyond_sigma");
  EXPECT_EQ(held[0].severity, Severity::kHolds);
  EXPECT_TRUE(held[0].text.starts_with("700 times the stated sigma is left")) << held[0].text;
}

TEST(ModelGuards, ItLeadsAmongTheNotesOfTheModel) {
  const CompensatedModel model = leaving(700, 700);
  ASSERT_FALSE(notes_of(model).empty());
  EXPECT_EQ(notes_of(model).front(), guards_of(model).front().text);
}

TEST(ModelGuards, SingleBadPosesAndRowsWithALargerSigmaOfTheirOwnHoldNothing) {
  EXPECT_DOUBLE_EQ(sigmas_left(leaving(700, 0)), 1);
}

TEST(ModelGuards, WhatABiasTakesIsNotLeft) { EXPECT_TRUE(guards_of(leaving(1.1, 80)).empty()); }

}  // namespace
}  // namespace trammel
