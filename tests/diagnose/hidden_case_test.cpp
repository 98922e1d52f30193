#include "tests/support/hidden_case.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/error_sources/physical_model.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/measurement.h"
#include "tests/support/demand.h"
#include "tests/support/hidden_files.h"

// The second simulation, held against the server's where both say the same thing, and against
// itself.

namespace trammel {
namespace {

using hidden::HiddenCase;
using hidden::HiddenSpec;

std::shared_ptr<const Cell> cell_of(const HiddenCase& hidden) {
  return std::make_shared<const Cell>(
      test::demand(parse_cell(hidden.cell_yaml, hidden.robot_yaml, "cell.yaml")));
}

MeasurementBatch batch_of(const HiddenCase& hidden, const Cell& cell) {
  return test::demand(
             check_against_cell(test::demand(parse_batch_csv(hidden.batch_csv, "batch.csv")), cell))
      .rows();
}

/// Largest distance, mm, of the two simulations' tool points, and angle, rad, between their tools.
struct Gap {
  double distance = 0, angle = 0;
};

Gap gap_between(const PhysicalModel& model, const MeasurementBatch& batch,
                const hidden::Frames& frames) {
  Gap gap;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Pose X_WT = model.pose_W(batch.measurements[i].context);
    const Eigen::Vector3d p = frames[i].block<3, 1>(0, 3);
    const Eigen::Matrix3d R = frames[i].block<3, 3>(0, 0);
    gap.distance = std::max(gap.distance, (1e3 * X_WT.translation() - p).norm());
    gap.angle = std::max(gap.angle,
                         Eigen::AngleAxisd(Eigen::Matrix3d(X_WT.linear().transpose() * R)).angle());
  }
  return gap;
}

TEST(HiddenRobot, StandsWhereTheServersChainStands) {
  HiddenCase hidden = hidden::hide({.kind = "null_white", .poses = 50});
  const auto cell = cell_of(hidden);
  const MeasurementBatch batch = batch_of(hidden, *cell);
  hidden.world.arm = hidden::drawn_arm();
  const Gap gap = gap_between(test::demand(make_physical_model(cell, {})), batch,
                              hidden::frames_at(hidden.world, hidden.world.poses, {}));
  EXPECT_LT(gap.distance, 1e-6);
  EXPECT_LT(gap.angle, 1e-8);
}

TEST(HiddenRobot, GivesWayAsTheServersEquilibriumDoes) {
  HiddenCase hidden = hidden::hide({.kind = "null_white", .seed = 7, .poses = 50});
  const auto cell = cell_of(hidden);
  const MeasurementBatch batch = batch_of(hidden, *cell);
  PhysicalModel model =
      test::demand(make_physical_model(cell, {"base", "geometry", "compliance_equilibrium"}));
  Eigen::VectorXd values(36);
  const auto& parameters = hidden::arm_parameters();
  for (Eigen::Index k = 0; k < 36; ++k) {
    const hidden::ArmParameter& parameter = parameters[static_cast<std::size_t>(k)];
    values(k) = 0.1 * parameter.unit *
                (parameter.group == "compliance" ? 1 : std::sin(5.0 * static_cast<double>(k)));
    const bool length = parameter.unit == 2;
    model.values(k) = values(k) * (length ? 1e-3 : parameter.group == "compliance" ? 1e3 : 1);
    ASSERT_EQ(model.parameters()[static_cast<std::size_t>(k)].name, parameter.name);
  }
  hidden.world.arm = changed(hidden::drawn_arm(), values);
  const Gap gap =
      gap_between(model, batch, hidden::frames_at(hidden.world, hidden.world.poses, {}));
  EXPECT_LT(gap.distance, 1e-5);
  EXPECT_LT(gap.angle, 1e-8);
}

TEST(HiddenRobot, BendsAboutAsTheServersBeamDoes) {
  HiddenCase hidden = hidden::hide({.kind = "link_bending", .seed = 3, .poses = 60});
  const auto cell = cell_of(hidden);
  const MeasurementBatch batch = batch_of(hidden, *cell);
  hidden.world.arm = hidden::drawn_arm();
  hidden.world.arm.flex[1] = 1e-13;
  PhysicalModel model = test::demand(make_physical_model(cell, {"link_bending:2"}));
  const hidden::Frames bent = hidden::frames_at(hidden.world, hidden.world.poses, {});
  const double without = gap_between(model, batch, bent).distance;
  model.values(0) = 1e-13 * 1e6;
  EXPECT_GT(without, 0.1);
  EXPECT_LT(gap_between(model, batch, bent).distance, 0.1 * without);
}

TEST(HiddenCase, EveryCauseReachesTheStrengthAskedFor) {
  for (const std::string& kind : hidden::decidable_kinds()) {
    for (const bool orientation : {true, false}) {
      const HiddenCase hidden = hidden::hide(
          {.kind = kind, .seed = 5, .lambda = 60, .poses = 120, .orientation = orientation});
      ASSERT_EQ(hidden.truth.lambdas.size(), 1u) << kind;
      EXPECT_NEAR(hidden.truth.lambdas[0], 60, 1e-3) << kind;
      EXPECT_EQ(hidden.truth.causes[0].cause, kind);
    }
  }
}

TEST(HiddenCase, StrengthIsWhatAFitOfTheArmLeavesOfTheEffect) {
  const HiddenSpec spec{.kind = "backlash", .seed = 11, .lambda = 200, .poses = 150};
  const HiddenCase hidden = hidden::hide(spec);
  const hidden::World& world = hidden.world;
  const Eigen::VectorXd effect =
      whitened(world, hidden::frames_at(world, world.poses, world.effects),
               hidden::frames_at(world, world.poses, {}));
  const Eigen::MatrixXd columns = arm_columns(world, world.poses);
  const Eigen::MatrixXd square =
      columns.transpose() * columns + Eigen::MatrixXd::Identity(columns.cols(), columns.cols());
  const Eigen::VectorXd left = effect - columns * square.ldlt().solve(columns.transpose() * effect);
  EXPECT_NEAR(left.dot(effect), 200, 4);
}

TEST(HiddenCase, NoiseAloneIsWhiteAndOfTheTrackersSize) {
  const HiddenCase hidden = hidden::hide({.kind = "null_white", .seed = 2, .poses = 400});
  EXPECT_TRUE(hidden.truth.causes.empty());
  const auto cell = cell_of(hidden);
  const MeasurementBatch batch = batch_of(hidden, *cell);
  const hidden::Frames still = hidden::frames_at(hidden.world, hidden.world.poses, {});
  double sum = 0;
  for (std::size_t i = 0; i < still.size(); ++i) {
    const Eigen::Vector3d p = 1e3 * batch.measurements[i].p_W;
    const Eigen::Matrix3d R = *batch.measurements[i].R_WT;
    sum += (p - still[i].block<3, 1>(0, 3)).squaredNorm() / (0.013 * 0.013);
    sum += std::pow(
        Eigen::AngleAxisd(Eigen::Matrix3d(R * still[i].block<3, 3>(0, 0).transpose())).angle() /
            61e-6,
        2);
  }
  EXPECT_NEAR(sum, 2400, 5 * std::sqrt(2 * 2400.0));  // chi-square
}

TEST(HiddenCase, WhatCannotBeToldIsAbsorbedWhole) {
  for (const char* kind :
       {"backlash_one_side", "payload_alone", "tool_absorbed", "constant_warmth"}) {
    const HiddenCase hidden = hidden::hide({.kind = kind, .seed = 4, .poses = 150});
    EXPECT_EQ(hidden.truth.question, hidden::Question::kAbstain);
    EXPECT_LT(hidden.truth.lambdas[0], 15) << kind;
    EXPECT_GT(hidden.truth.absorbed[0], 0.99) << kind;
  }
}

TEST(HiddenCase, ASlippedJointOneLooksLikeATurnedTracker) {
  // Both draws of the kind, found by their seeds, make rows that one column explains.
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const HiddenCase hidden =
        hidden::hide({.kind = "joint1_or_tracker", .seed = seed, .poses = 80});
    const hidden::World& world = hidden.world;
    const int first = hidden.truth.causes[0].first;
    const hidden::Frames still = hidden::frames_at(world, world.poses, {});
    const Eigen::VectorXd rows =
        whitened(world, hidden::frames_at(world, world.poses, world.effects), still);
    Eigen::VectorXd turned = whitened(
        world,
        [&] {
          hidden::Frames frames = still;
          for (std::size_t i = static_cast<std::size_t>(first); i < frames.size(); ++i) {
            frames[i] = world.arm.base * hidden::motion(Eigen::Vector3d::Zero(), 1e-5, 0, 0) *
                        world.arm.base.inverse() * frames[i];
          }
          return frames;
        }(),
        still);
    const double cosine = rows.dot(turned) / (rows.norm() * turned.norm());
    EXPECT_GT(std::abs(cosine), 0.9999) << seed;
  }
}

TEST(HiddenCase, MixturesReachTheStrengthEachBesidesTheOthers) {
  const HiddenCase hidden = hidden::hide(
      {.kind = "backlash+thermal_growth+outlier", .seed = 6, .lambda = 90, .poses = 120});
  ASSERT_EQ(hidden.truth.causes.size(), 3u);
  for (const double lambda : hidden.truth.lambdas) EXPECT_NEAR(lambda, 90, 1e-3);
}

TEST(HiddenCase, TheSameSpecIsTheSameCase) {
  const HiddenSpec spec{.kind = "mixture2", .seed = 9, .poses = 100};
  EXPECT_EQ(hidden::hide(spec).batch_csv, hidden::hide(spec).batch_csv);
  EXPECT_NE(hidden::hide(spec).batch_csv,
            hidden::hide({.kind = "mixture2", .seed = 10, .poses = 100}).batch_csv);
}

TEST(HiddenCase, EveryKindIsReadByTheServer) {
  std::vector<std::string> kinds = hidden::decidable_kinds();
  for (const auto* more :
       {&hidden::null_kinds(), &hidden::unknown_kinds(), &hidden::slow_kinds(),
        &hidden::foreign_kinds(), &hidden::undecidable_kinds(), &hidden::replica_kinds()}) {
    kinds.insert(kinds.end(), more->begin(), more->end());
  }
  kinds.insert(kinds.end(), {"mixture2", "mixture3"});
  EXPECT_GE(hidden::decidable_kinds().size(), 15u);
  for (const std::string& kind : kinds) {
    const HiddenCase hidden = hidden::hide({.kind = kind, .seed = 8, .poses = 80});
    const auto cell = cell_of(hidden);
    EXPECT_GE(batch_of(hidden, *cell).measurements.size(), 35u) << kind;
  }
}

TEST(HiddenCase, ThePanelIsUprightAndItsHolesAreWhereTheyShouldBe) {
  hidden::HiddenCase hidden = hidden::hide({.kind = "replica_p28", .seed = 1});
  ASSERT_EQ(hidden.world.poses.size(), 35u);
  hidden.world.arm = hidden::drawn_arm();
  const hidden::Frames frames = hidden::frames_at(hidden.world, hidden.world.poses, {});
  EXPECT_NEAR((frames[34] - frames[0])(1, 3), 500, 1e-6);
  EXPECT_NEAR((frames[34] - frames[0])(2, 3), 1200, 1e-6);
  EXPECT_NEAR((frames[34] - frames[0])(0, 3), 0, 1e-6);
  EXPECT_EQ(hidden.truth.causes[0].first, 27);
}

}  // namespace
}  // namespace trammel
