#include "server/robot/lead_in.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/units.h"
#include "server/compensate/compensated_model.h"
#include "server/compensate/take_ups.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

constexpr double kHalfPlay = 1e-4;  // rad

/// cell-7 whose joints 1 to 3 have play, and that of joint 2 friction too, if asked for.
CompensatedModel arm_with_play(bool friction = false) {
  std::vector<std::string> sources = {"backlash:1", "backlash:2", "backlash:3"};
  if (friction) sources.emplace_back("hysteresis:2");
  CompensatedModel::Parts parts;
  parts.physics = test::demand(make_physical_model(test::cell_7(), sources));
  std::vector<double> values;
  for (const Parameter& parameter : parts.physics.parameters()) {
    const bool play = parameter.name.starts_with("b") && !parameter.name.starts_with("bt");
    values.push_back(play                                 ? kHalfPlay
                     : parameter.name.starts_with("hyst") ? kHalfPlay
                     : parameter.name.starts_with("way")  ? 0.02
                                                          : 0);
    parts.parameters.push_back({parameter, values.back(), 0, true});
  }
  parts.physics.values =
      Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  parts.q_min = JointVector::Constant(6, -1);
  parts.q_max = JointVector::Constant(6, 1);
  const auto P = parts.physics.parameter_count();
  parts.covariance = Eigen::MatrixXd::Zero(P, P);
  parts.trained_with = {{"spindle", "spindle"}};
  return test::demand(CompensatedModel::make(std::move(parts)));
}

JointVector joints(double first) {
  JointVector q(6);
  q << first, 0.1, 0.2, 0.15, 0.9, 0.3;
  return q;
}

Target hole(double first) {
  Target target;
  target.joint_target = true;
  target.seed = joints(first);
  return target;
}

/// m, from where the tool stands if the gears came from these sides to where it is wanted.
double miss(const CompensatedModel& model, const Correction& corrected, std::vector<int> sides) {
  PoseContext arm;
  arm.q = corrected.q;
  arm.tool = arm.payload = "spindle";
  arm.direction = std::move(sides);
  const PhysicalModel& physics = model.parts().physics;
  return (physics.X_WB.inverse() * physics.pose_W(arm).translation() -
          corrected.X_BT_wanted.translation())
      .norm();
}

TEST(LeadIn, PlayIsTakenUpSoThatHolesAreWhereTheyAreWanted) {
  const CompensatedModel model = arm_with_play();
  const std::vector<TakeUp> known = take_ups(model);
  ASSERT_EQ(known.size(), 3u);
  const Pose X_FT = model.parts().physics.tools.at("spindle");
  double without = 0, with = 0;
  for (int k = 0; k < 8; ++k) {
    Target target = hole(-0.7 + 0.2 * k);
    const Correction plain = model.correct(target, "spindle", "spindle");
    ASSERT_EQ(plain.status, CorrectionStatus::kOk) << plain.message;
    const int from = k % 2 == 0 ? 1 : -1;
    without += std::pow(miss(model, plain, {from, -from, from, 0, 0, 0}), 2);
    const auto way = lead_in(model.cell().robot, plain.q, X_FT, known);
    ASSERT_TRUE(way);
    target.direction = way->sides;
    const Correction led = model.correct(target, "spindle", "spindle");
    ASSERT_EQ(led.status, CorrectionStatus::kOk) << led.message;
    with += std::pow(miss(model, led, way->sides), 2);
    EXPECT_LT(led.error_after, 0.2 * plain.error_after) << "sigma knows it";
  }
  EXPECT_GT(std::sqrt(without / 8), from_mm(0.1)) << "play matters here";
  EXPECT_LT(std::sqrt(with), 0.2 * std::sqrt(without));
}

TEST(LeadIn, EveryGearTurnsOneWayByMoreThanItsPlayAndTheToolComesAlongItsAxis) {
  const CompensatedModel model = arm_with_play();
  const Chain& robot = model.cell().robot;
  const Pose X_FT = model.parts().physics.tools.at("spindle");
  const std::vector<TakeUp> known = take_ups(model);
  for (int k = 0; k < 20; ++k) {
    const JointVector q = joints(-0.93 + 0.09 * k);
    const auto way = lead_in(robot, q, X_FT, known);
    ASSERT_TRUE(way) << k;
    for (const TakeUp& one : known) {
      const int side = way->sides[static_cast<std::size_t>(one.joint)];
      double all = 0;
      JointVector at = way->offsets.front();
      for (std::size_t n = 1; n <= way->offsets.size(); ++n) {
        const JointVector next =
            n < way->offsets.size() ? way->offsets[n] : JointVector(JointVector::Zero(6));
        const double turn = robot.gear_angles(next - at)(one.joint);
        EXPECT_GE(side * turn, -1e-6) << "joint " << one.joint + 1 << " turns back";
        all += side * turn;
        at = next;
      }
      EXPECT_GE(all, one.way - 1e-6);
      EXPECT_GT(one.way, 2 * 2 * kHalfPlay);
    }
    const Pose X_TL = (robot.flange_pose(q) * X_FT).inverse() *
                      (robot.flange_pose(q + way->offsets.back()) * X_FT);
    EXPECT_LT((X_TL.translation() - Vector3(0, 0, -kBackOff)).norm(), 1e-8);
  }
}

TEST(LeadIn, AJointThatStandsAtItsLimitComesFromTheOtherSideOrNotAtAll) {
  const Chain& robot = test::cell_7()->robot;
  JointVector q = joints(robot.joint(0).lower + from_deg(0.2));
  const Pose X_FT = Pose::Identity();
  for (const int side : {1, -1}) {
    const auto way = lead_in(robot, q, X_FT, {{0, from_deg(1), side}});
    if (!way) continue;
    for (const JointVector& offset : way->offsets)
      EXPECT_FALSE(robot.joint_outside_limits(q + offset));
  }
  EXPECT_FALSE(lead_in(robot, q, X_FT, {})) << "nothing is to be taken up";
}

TEST(LeadIn, HysteresisIsKnownWhereTheSideIsSaidOfThatJoint) {
  const CompensatedModel model = arm_with_play(true);
  EXPECT_GE(take_ups(model)[1].way, kSaidMove);
  Target target = hole(0.2);
  target.direction = {1, 1, 1, 0, 0, 0};
  const Correction said = model.correct(target, "spindle", "spindle");
  target.direction = {1, 0, 1, 0, 0, 0};
  const Correction unsaid = model.correct(target, "spindle", "spindle");
  EXPECT_LT(said.stddev, 0.1 * unsaid.stddev);
}

}  // namespace
}  // namespace trammel
