#include "server/robot/wrist.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "server/base/units.h"
#include "server/compensate/compensated_model.h"
#include "server/robot/inverse_kinematics.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

constexpr double kSpacing = 2e-4;  // m, between neighbours of a path

/// A robot that was calibrated around a stretched wrist, over a range that the paths leave.
class ThroughTheWrist : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    auto cell = std::make_shared<Cell>(*test::cell_7());
    const auto deg = [](double low, double high) {
      return std::pair{from_deg(low), from_deg(high)};
    };
    cell->joint_ranges = {deg(-3, 15),    deg(-15, 15), deg(-15, 30),
                          deg(-170, 170), deg(-40, 40), deg(-170, 170)};
    robot_ = new VirtualRobot(test::chapter_5_robot(cell));
    TrainOptions options;
    options.level = "M3";
    options.bias = "se";
    model_ =
        new CompensatedModel(test::demand(train(cell, test::measured(*robot_, 150, 7), options)));
  }
  static void TearDownTestSuite() {
    delete robot_;
    delete model_;
  }

  static const Chain& arm() { return model_->cell().robot; }
  static Pose X_FT() { return model_->parts().physics.tools.at("spindle"); }
  static PoseContext at(const JointVector& q) {
    PoseContext context;
    context.q = q;
    context.tool = context.payload = "spindle";
    return context;
  }
  static Pose truth(const JointVector& q) { return robot_->truth.pose_W(at(q)); }
  static Pose nominal(const JointVector& q) { return arm().flange_pose(q) * X_FT(); }
  static Correction correct(const Pose& X_BT, const JointVector& q) {
    Target target;
    target.X_BT = X_BT;
    target.seed = q;
    return model_->correct(target, "spindle", "spindle");
  }
  static JointVector stretched() {
    JointVector q(6);
    q << from_deg(-1), 0.1, 0.1, 0.4, 0, -0.3;
    return q;
  }
  /// The joints that the controller takes on its way, from those before.
  static JointVector next(const Pose& X_BT, const JointVector& before) {
    JointVector nearest;
    double least = 1e9;
    for (const int conf : {0, 1}) {  // the wrist may pass through, elbow and shoulder stay
      const auto found = inverse_kinematics(arm(), X_BT * X_FT().inverse(), conf, before);
      if (!found || found->status == InverseStatus::kUnreachable) continue;
      if (const double way = (found->q - before).norm(); way < least) {
        least = way;
        nearest = found->q;
      }
    }
    if (const auto wrist = wrist_opening(arm(), nearest, 1e-9))
      nearest = turned_idly(arm(), nearest, *wrist, before(3));
    return nearest;
  }

  struct Jumps {
    double correction = 0, truth = 0;  ///< m, largest between neighbours
    int corrected = 0, count = 0, in_wrist = 0, outside = 0;
    double worst = 0;  ///< m, how far the true tool is from where it is wanted
  };
  /// Along a path around the point that the tool has with the wrist stretched, `beside` (m) that
  /// point.
  static Jumps along(const std::function<Vector3(double)>& place, double length, double beside) {
    Jumps jumps;
    const Pose middle = nominal(stretched());
    Vector3 correction = Vector3::Zero(), error = Vector3::Zero();
    JointVector before = stretched();
    before(4) = beside > 0 ? 1e-3 : -1e-3;
    for (double s = 0; s < length; s += kSpacing) {
      Pose X_BT = middle;
      X_BT.translation() += place(s) + Vector3(0, 0, beside);
      const JointVector q = next(X_BT, before);
      before = q;
      const Correction made = correct(X_BT, q);
      ++jumps.count;
      if (made.status != CorrectionStatus::kOk && made.status != CorrectionStatus::kOutOfDomain) {
        ADD_FAILURE() << made.message;
        continue;
      }
      ++jumps.corrected;
      if (made.status == CorrectionStatus::kOutOfDomain) ++jumps.outside;
      if (wrist_opening(arm(), q, from_deg(6))) ++jumps.in_wrist;
      const Vector3 now = made.X_BT_commanded.translation() - X_BT.translation();
      const Vector3 true_now = truth(q).translation() - X_BT.translation();
      if (s > 0) {
        jumps.correction = std::max(jumps.correction, (now - correction).norm());
        jumps.truth = std::max(jumps.truth, (true_now - error).norm());
      }
      correction = now;
      error = true_now;
      if (made.status == CorrectionStatus::kOk)
        jumps.worst =
            std::max(jumps.worst, (truth(made.q).translation() - X_BT.translation()).norm());
    }
    return jumps;
  }
  static void expect_smooth(const Jumps& jumps) {
    EXPECT_EQ(jumps.corrected, jumps.count);
    EXPECT_GT(jumps.in_wrist, 50);
    EXPECT_LE(jumps.correction, 1.2 * jumps.truth + 1e-6)
        << to_mm(jumps.correction) << " mm, truth " << to_mm(jumps.truth) << " mm";
    EXPECT_LT(to_mm(jumps.worst), 0.1);
  }

  static VirtualRobot* robot_;
  static CompensatedModel* model_;
};
VirtualRobot* ThroughTheWrist::robot_ = nullptr;
CompensatedModel* ThroughTheWrist::model_ = nullptr;

TEST_F(ThroughTheWrist, ACircleIsCorrectedWithoutAJump) {
  constexpr double kRadius = 0.05;
  const auto circle = [](double s) {
    const double a = s / kRadius;
    return Vector3(0, kRadius * std::sin(a), kRadius * (1 - std::cos(a)));
  };
  for (const double beside : {0.0, 1e-5, 5e-4, -5e-3}) {
    SCOPED_TRACE(beside);
    expect_smooth(along(circle, 2 * kPi * kRadius, beside));
  }
}

TEST_F(ThroughTheWrist, ASpiralAcrossTheEdgeOfTheDomainIsCorrectedWithoutAJump) {
  // Around a point 60 mm beside, so that the third turn meets the singularity and axis 4 is not
  // wound up.
  const auto spiral = [](double s) {
    const double a = (std::sqrt(0.03 * 0.03 + 2 * 0.0032 * s) - 0.03) / 0.0032,
                 r = 0.03 + 0.0032 * a;
    return Vector3(0, 0.06 + r * std::cos(a), r * std::sin(a));
  };
  const Jumps jumps = along(spiral, 0.46, 0);
  expect_smooth(jumps);
  EXPECT_GT(jumps.outside, 20) << "the path does not leave the domain";
}

TEST_F(ThroughTheWrist, WhatCannotBeTurnedIsSaidAndThePointIsWhereItIsWanted) {
  const JointVector q = stretched();
  const Correction made = correct(nominal(q), q);
  ASSERT_EQ(made.status, CorrectionStatus::kOk) << made.message;
  EXPECT_NE(made.message.find("at a singular wrist"), std::string::npos) << made.message;
  EXPECT_NE(made.message.find("of the base are left"), std::string::npos) << made.message;
  EXPECT_LT(to_mm((truth(made.q).translation() - nominal(q).translation()).norm()), 0.1);
  EXPECT_LT((made.q - q).cwiseAbs().maxCoeff(), from_deg(3)) << "no axis swings";
  EXPECT_LT((made.X_BT_commanded.matrix() - nominal(made.q).matrix()).norm(), 1e-12);
}

TEST_F(ThroughTheWrist, TheWristStaysOnItsSide) {
  for (const double opening : {1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2}) {
    for (const double side : {-1.0, 1.0}) {
      JointVector q = stretched();
      q(4) = side * opening;
      const Correction made = correct(nominal(q), q);
      ASSERT_EQ(made.status, CorrectionStatus::kOk) << made.message;
      EXPECT_GT(made.q(4) * side, 0) << opening;
      const auto again = inverse_kinematics(arm(), made.X_BT_commanded * X_FT().inverse(),
                                            side < 0 ? 1 : 0, made.q);
      EXPECT_LT((again->q - made.q).norm(), 1e-5) << "what the controller makes of it";
    }
  }
}

TEST_F(ThroughTheWrist, AtTheBorderBothWaysOfCorrectingMeet) {
  JointVector inside = stretched(), outside = stretched();
  inside(4) = 0.1049999;
  outside(4) = 0.1050001;
  const Correction one = correct(nominal(inside), inside),
                   other = correct(nominal(outside), outside);
  EXPECT_LT(((one.q - inside) - (other.q - outside)).norm(), 1e-5);
  EXPECT_LT((one.X_BT_commanded.translation() - nominal(inside).translation() -
             (other.X_BT_commanded.translation() - nominal(outside).translation()))
                .norm(),
            2e-7);
}

TEST_F(ThroughTheWrist, AnotherSingularityIsLeftWithTheDirection) {
  JointVector q = stretched();
  q(4) = 0.6;
  q(2) = -std::atan2(1.142, 0.2);  // the forearm in line with the upper arm
  const Correction made = correct(nominal(q), q);
  EXPECT_EQ(made.status, CorrectionStatus::kSingular);
  EXPECT_NE(made.message.find("it cannot "), std::string::npos) << made.message;
}

}  // namespace
}  // namespace trammel
