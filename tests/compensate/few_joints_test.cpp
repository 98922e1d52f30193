#include "server/compensate/few_joints.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/base/units.h"
#include "server/compensate/compensated_model.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/files/batch_file.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"

namespace trammel {
namespace {

/// Rows `d theta a alpha` in m and rad, as the drawing has them and as the arm was built.
struct Row {
  double d, theta, a, alpha;
  bool slides = false;
};

struct FewJointsArm {
  std::string name;
  std::vector<Row> drawn, built;
  std::vector<std::pair<double, double>> limits;  ///< deg or mm
};

/// Two parallel arms, a quill that slides downwards, and a turning flange; the second arm is too
/// long, the zero of joint 2 is off, the quill leans.
FewJointsArm scara() {
  FewJointsArm arm{"scara",
                   {{0.34, 0, 0.325, 0}, {0, 0, 0.275, kPi}, {0, 0, 0, 0, true}, {0.05, 0, 0, 0}},
                   {},
                   {}};
  arm.built = arm.drawn;
  arm.built[0].a += 0.4e-3;
  arm.built[1].a -= 0.6e-3;
  arm.built[1].theta += from_deg(0.08);
  arm.built[1].alpha += from_deg(0.03);
  arm.built[0].alpha += from_deg(0.02);
  arm.limits = {{-120, 120}, {10, 140}, {20, 180}, {-300, 300}};
  return arm;
}

/// A palletiser's kind of arm: turntable, three parallel axes, a flange that turns.
FewJointsArm five_axes() {
  const double right = kPi / 2;
  FewJointsArm arm{"five",
                   {{0.5, 0, 0.15, right},
                    {0, right, 0.6, 0},
                    {0, 0, 0.55, 0},
                    {0, -right, 0.08, -right},
                    {0.12, 0, 0, 0}},
                   {},
                   {}};
  arm.built = arm.drawn;
  arm.built[1].a += 0.5e-3;
  arm.built[2].theta -= from_deg(0.05);
  arm.built[3].a += 0.3e-3;
  arm.built[0].alpha += from_deg(0.02);
  arm.built[3].theta += from_deg(0.06);
  arm.limits = {{-160, 160}, {-60, 60}, {-110, -20}, {-60, 60}, {-180, 180}};
  return arm;
}

const Vector3 kTool(0.03, 0.01, 0.11);

Pose flange(const std::vector<Row>& rows, const JointVector& q) {
  Pose X = Pose::Identity();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const double value = q(static_cast<Eigen::Index>(i));
    X = X * Eigen::Translation3d(0, 0, row.d + (row.slides ? value : 0)) *
        Eigen::AngleAxisd(row.theta + (row.slides ? 0 : value), Vector3::UnitZ()) *
        Eigen::Translation3d(row.a, 0, 0) * Eigen::AngleAxisd(row.alpha, Vector3::UnitX());
  }
  return X;
}
Pose tool(const std::vector<Row>& rows, const JointVector& q) {
  return flange(rows, q) * Pose(Eigen::Translation3d(kTool));
}

std::string robot_yaml(const FewJointsArm& arm) {
  std::string text = fmt::format("version: 1\nname: {}\njoints:\n", arm.name);
  for (std::size_t i = 0; i < arm.drawn.size(); ++i) {
    const Row& row = arm.drawn[i];
    text += fmt::format(
        "  - {{type: {}, d_mm: {:.6f}, theta_deg: {:.9f}, a_mm: {:.6f}, alpha_deg: {:.9f}, {}: "
        "[{}, {}]}}\n",
        row.slides ? "prismatic" : "revolute", to_mm(row.d), to_deg(row.theta), to_mm(row.a),
        to_deg(row.alpha), row.slides ? "limits_mm" : "limits_deg", arm.limits[i].first,
        arm.limits[i].second);
  }
  return text;
}

std::shared_ptr<const Cell> cell_of(const FewJointsArm& arm) {
  const std::string cell = fmt::format(
      "version: 1\ncell: {}\nrobot: robot.yaml\nbase: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}}\n"
      "tools: {{gripper: {{xyz_mm: [{}, {}, {}], q_wxyz: [1, 0, 0, 0]}}}}\n"
      "tracker: {{sigma_mm: 0.01, sigma_deg: 0.003}}\nmodel: {{error_sources: [base, geometry], "
      "bias: none}}\n",
      arm.name, to_mm(kTool.x()), to_mm(kTool.y()), to_mm(kTool.z()));
  return std::make_shared<const Cell>(
      test::demand(parse_cell(cell, robot_yaml(arm), arm.name + ".yaml")));
}

class Poses {
 public:
  Poses(const FewJointsArm& arm, std::uint64_t seed) : arm_(arm), random_(seed) {}
  JointVector next() {
    JointVector q(static_cast<Eigen::Index>(arm_.limits.size()));
    for (std::size_t i = 0; i < arm_.limits.size(); ++i) {
      const auto [low, high] = arm_.limits[i];
      const double value = std::uniform_real_distribution<double>(0.9 * low + 0.1 * high,
                                                                  0.1 * low + 0.9 * high)(random_);
      q(static_cast<Eigen::Index>(i)) = arm_.drawn[i].slides ? from_mm(value) : from_deg(value);
    }
    return q;
  }
  double noise(double sigma) { return std::normal_distribution<double>(0, sigma)(random_); }

 private:
  const FewJointsArm& arm_;
  std::mt19937_64 random_;
};

/// Measurements of the arm as built, by a tracker.
std::string measured(const FewJointsArm& arm, int count) {
  Poses poses(arm, 11);
  std::string csv;
  for (std::size_t i = 0; i < arm.drawn.size(); ++i)
    csv += fmt::format("q{}_{},", i + 1, arm.drawn[i].slides ? "mm" : "deg");
  csv += "x_mm,y_mm,z_mm,qw,qx,qy,qz\n";
  for (int row = 0; row < count; ++row) {
    const JointVector q = poses.next();
    for (std::size_t i = 0; i < arm.drawn.size(); ++i) {
      const double value = q(static_cast<Eigen::Index>(i));
      csv += fmt::format("{:.9f},", arm.drawn[i].slides ? to_mm(value) : to_deg(value));
    }
    const Pose X = tool(arm.built, q);
    Vector3 p = X.translation(), turn;
    for (int axis = 0; axis < 3; ++axis)
      p(axis) += poses.noise(1e-5), turn(axis) = poses.noise(from_deg(0.003));
    const Eigen::Quaterniond r(rotation_exp(turn) * X.linear());
    csv += fmt::format("{:.6f},{:.6f},{:.6f},{:.9f},{:.9f},{:.9f},{:.9f}\n", to_mm(p.x()),
                       to_mm(p.y()), to_mm(p.z()), r.w(), r.x(), r.y(), r.z());
  }
  return csv;
}

struct Trained {
  FewJointsArm arm;
  std::shared_ptr<const Cell> cell;
  CompensatedModel model;
};

Trained trained(const FewJointsArm& arm) {
  const auto cell = cell_of(arm);
  TrainOptions options;
  options.bias = "none";
  const CheckedBatch batch = test::demand(
      check_against_cell(test::demand(parse_batch(measured(arm, 120), "batch.csv")), *cell));
  return {arm, cell, test::demand(train(cell, batch, options))};
}

Target target_at(const Trained& robot, const JointVector& q) {
  Target target;
  target.X_BT = tool(robot.arm.drawn, q);
  target.seed = q;
  return target;
}
Correction corrected(const Trained& robot, const Target& target) {
  return robot.model.correct(target, "gripper", "");
}

class ArmOfFewJoints : public testing::TestWithParam<FewJointsArm> {};

TEST_P(ArmOfFewJoints, PutsThePointOfItsToolWhereItIsWanted) {
  const Trained robot = trained(GetParam());
  Poses poses(robot.arm, 5);
  double before = 0, after = 0, expected = 0;
  for (int i = 0; i < 60; ++i) {
    const Target target = target_at(robot, poses.next());
    const Correction made = corrected(robot, target);
    ASSERT_EQ(to_string(made.status), "ok") << made.message;
    before = std::max(
        before,
        (tool(robot.arm.built, *target.seed).translation() - target.X_BT.translation()).norm());
    after = std::max(
        after, (tool(robot.arm.built, made.q).translation() - target.X_BT.translation()).norm());
    expected = std::max(expected, made.error_after);
    // The controller's own kinematics bring the tool to what is commanded.
    EXPECT_LT(
        (tool(robot.arm.drawn, made.q).translation() - made.X_BT_commanded.translation()).norm(),
        1e-9);
  }
  EXPECT_GT(to_mm(before), 0.5);
  EXPECT_LT(to_mm(after), 0.02);
  EXPECT_LT(to_mm(expected), 0.03);
}

TEST_P(ArmOfFewJoints, TellsWhatIsLeftOfTheRotation) {
  const Trained robot = trained(GetParam());
  const Target target = target_at(robot, Poses(robot.arm, 6).next());
  const Correction made = corrected(robot, target);
  const Vector3 left = pose_difference(target.X_BT, tool(robot.arm.built, made.q)).tail<3>();
  ASSERT_GT(to_deg(left.norm()), 0.005);
  EXPECT_NEAR(to_deg(made.turn_after), to_deg(left.norm()), 0.004);
  EXPECT_NE(made.message.find(fmt::format("with {} joints", robot.arm.drawn.size())),
            std::string::npos)
      << made.message;
}

TEST_P(ArmOfFewJoints, TakesATargetWhoseOrientationWasRounded) {
  const Trained robot = trained(GetParam());
  Poses poses(robot.arm, 7);
  for (int i = 0; i < 10; ++i) {
    Target target = target_at(robot, poses.next());
    target.X_BT.linear() = rotation_exp(Vector3(5e-5, -5e-5, 5e-5)) * target.X_BT.linear();
    const Correction made = corrected(robot, target);
    ASSERT_EQ(to_string(made.status), "ok") << made.message;
    EXPECT_LT((tool(robot.arm.built, made.q).translation() - target.X_BT.translation()).norm(),
              2e-5);
  }
}

TEST_P(ArmOfFewJoints, CannotTurnTheToolInEveryWayAndSaysSo) {
  const Trained robot = trained(GetParam());
  Target target = target_at(robot, Poses(robot.arm, 8).next());
  // About a direction that no joint turns the tool about: across the tool's axis, in the arm's
  // plane.
  const Vector3 across = robot.arm.name == "scara" ? Vector3(Vector3::UnitX()) : [&] {
    const double azimuth = (*target.seed)(0);
    return Vector3(std::cos(azimuth), std::sin(azimuth), 0);
  }();
  target.X_BT.linear() = rotation_exp(from_deg(2) * across) * target.X_BT.linear();
  const Correction made = corrected(robot, target);
  EXPECT_EQ(to_string(made.status), "unreachable");
  EXPECT_NE(made.message.find("cannot turn the tool so"), std::string::npos) << made.message;
  EXPECT_TRUE(made.X_BT_commanded.isApprox(target.X_BT));
}

TEST_P(ArmOfFewJoints, DoesNotPassItsLimits) {
  const Trained robot = trained(GetParam());
  Poses poses(robot.arm, 9);
  int held = 0;
  for (int i = 0; i < 20; ++i) {
    JointVector q = poses.next();
    q(1) = from_deg(i % 2 == 0 ? robot.arm.limits[1].first : robot.arm.limits[1].second);
    const Correction made = corrected(robot, target_at(robot, q));
    if (to_string(made.status) == "joint_limit") ++held;
    EXPECT_FALSE(robot.cell->robot.joint_outside_limits(made.q));
  }
  EXPECT_GE(held, 5);
}

INSTANTIATE_TEST_SUITE_P(Made, ArmOfFewJoints, testing::Values(scara(), five_axes()),
                         [](const auto& made) { return made.param.name; });

TEST(Scara, IsNotCorrectedThroughItsStretchedElbow) {
  const Trained robot = trained(scara());
  JointVector q(4);
  q << 0.3, from_deg(1), 0.1, 0.5;
  int other = 0;
  for (double elbow = -0.1; elbow <= 0.1; elbow += 0.004) {
    q(1) = from_deg(elbow);
    const Correction made = corrected(robot, target_at(robot, q));
    if (to_string(made.status) != "ok") {
      ++other;
      continue;
    }
    EXPECT_GT(made.q(1) * q(1), 0) << elbow << " " << made.q(1);
  }
  EXPECT_GT(other, 10);
}

}  // namespace
}  // namespace trammel
