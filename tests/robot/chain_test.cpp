#include "server/robot/chain.h"

#include <gtest/gtest.h>

#include <random>

#include "server/base/units.h"
#include "server/robot/arm_state.h"
#include "server/robot/cell.h"

namespace trammel {
namespace {

Chain shipped_chain(const std::string& file) {
  const Result<Chain> chain = read_robot(std::string(TRAMMEL_SOURCE_DIR) + "/models/" + file);
  EXPECT_TRUE(chain) << (chain ? "" : chain.error().message);
  return *chain;
}

/// A made-up arm with everything a chain can have: a rail, a Hayati row, a reversed and a coupled
/// joint.
Chain odd_arm() {
  Joint rail;
  rail.type = JointType::kPrismatic;
  rail.link.alpha = 0.7;
  Joint shoulder;
  shoulder.link = {0.2, 0.4, 0.3, -1.3, 0};
  Joint elbow;
  elbow.link = {-0.5, 0, 0.9, 0.05, 0.02};
  elbow.hayati = true;
  Joint wrist;
  wrist.link = {0.1, 0.6, 0.1, 1.1, 0};
  wrist.sign = -1;
  elbow.mass = 12;
  elbow.p_cog = {-0.4, 0.05, 0.1};
  wrist.mass = 5;
  wrist.p_cog = {0.02, -0.1, 0.03};
  return *Chain::make("odd", {rail, shoulder, elbow, wrist}, {{3, 2, -0.8}});
}

JointVector random_joints(int n, std::mt19937_64& random) {
  std::uniform_real_distribution<double> angle(-1.5, 1.5);
  JointVector q(n);
  for (int i = 0; i < n; ++i) q(i) = angle(random);
  return q;
}

TEST(Chain, TheGearsOfACountingControllerTurnTheJointsAndThoseOfBarsAreCommanded) {
  std::mt19937_64 random(3);
  const Chain serial = odd_arm();
  std::vector<Joint> joints;
  for (int j = 0; j < serial.size(); ++j) joints.push_back(serial.joint(j));
  const Chain bars = *Chain::make("bars", joints, {{3, 2, -0.8, CouplingKind::kParallelogram}});
  const JointVector q = random_joints(4, random);
  EXPECT_EQ(bars.gear_angles(q), q);
  const JointVector gears = serial.gear_angles(q);
  EXPECT_EQ(gears.head(3), q.head(3));
  EXPECT_NEAR(gears(3), q(3) + 0.8 * q(2), 1e-12) << "joint 4 counts the other way";
  EXPECT_TRUE(serial.commanded(gears).isApprox(q, 1e-12));
  EXPECT_TRUE(bars.drive().isApprox(bars.transmission()));
  EXPECT_TRUE(serial.drive().isDiagonal());
  EXPECT_EQ(serial.transmission(), bars.transmission()) << "where the flange stands is the same";
}

TEST(Chain, PutsTheThesisRobotWhereItsDrawingDoes) {
  // Arm upright and forearm level: x = a1 + d4 + d6, z = d1 + a2 + a3.
  const Pose X_BF = shipped_chain("abb_irb6640-205-275.yaml").flange_pose(JointVector::Zero(6));
  EXPECT_NEAR(X_BF.translation().x(), 0.320 + 1.142 + 0.200, 1e-12);
  EXPECT_NEAR(X_BF.translation().y(), 0, 1e-12);
  EXPECT_NEAR(X_BF.translation().z(), 0.780 + 1.280 + 0.200, 1e-12);
  // A quarter turn about the base's y axis: the flange looks forward.
  EXPECT_NEAR((X_BF.linear().col(2) - Vector3::UnitX()).norm(), 0, 1e-12);
}

TEST(Chain, ReachesAsFarAsTheThesisRobotsNameSays) {
  // Stretched out forward, the wrist centre stands a1 + a2 + hypot(a3, d4) from axis 1: 2.75 m.
  JointVector q = JointVector::Zero(6);
  q(1) = kPi / 2;
  const Chain chain = shipped_chain("abb_irb6640-205-275.yaml");
  double reach = 0;
  for (double third = -kPi; third < kPi; third += 1e-3) {
    q(2) = third;
    const Pose X = chain.flange_pose(q);
    reach = std::max(reach, (X.translation() - 0.200 * X.linear().col(2)).head<2>().norm());
  }
  EXPECT_NEAR(reach, 2.75, 0.02);
}

TEST(Chain, PutsTheUr10WhereItsMakerDoes) {
  // All joints at zero: stretched out along -x, x = a2 + a3, y = -(d4 + d6), z = d1 - d5.
  const Vector3 p =
      shipped_chain("universal-robots_ur10.yaml").flange_pose(JointVector::Zero(6)).translation();
  EXPECT_NEAR(p.x(), -0.612 - 0.5723, 1e-9);
  EXPECT_NEAR(p.y(), -0.163941 - 0.0922, 1e-9);
  EXPECT_NEAR(p.z(), 0.1273 - 0.1157, 1e-9);
}

TEST(Chain, GeometricJacobianIsTheDerivativeOfTheFlangePose) {
  std::mt19937_64 random(1);
  for (const Chain& chain : {shipped_chain("abb_irb6640-205-275.yaml"),
                             shipped_chain("universal-robots_ur10.yaml"), odd_arm()}) {
    const JointVector q = random_joints(chain.size(), random);
    const Vector3 p_F(0.1, -0.2, 0.3);
    const Pose X_FT = make_pose(Matrix3::Identity(), p_F);
    const Eigen::MatrixXd J = chain.jacobian(q, p_F);
    for (int j = 0; j < chain.size(); ++j) {
      constexpr double kStep = 1e-6;
      JointVector ahead = q;
      JointVector behind = q;
      ahead(j) += kStep;
      behind(j) -= kStep;
      const Vector6 difference =
          pose_difference(chain.flange_pose(ahead) * X_FT, chain.flange_pose(behind) * X_FT) /
          (2 * kStep);
      EXPECT_LT((J.col(j) - difference).norm(), 1e-6) << chain.name() << " joint " << j + 1;
    }
  }
}

/// Every number of an arm, moved by `step` in state row `row`.
ArmState moved(ArmState state, int row, double step) {
  const int n = state.chain->size();
  const StateRows rows(n);
  if (row < rows.base(0)) {
    LinkGeometry& link = state.links[static_cast<std::size_t>(row / 5)];
    double* const members[] = {&link.theta, &link.d, &link.a, &link.alpha, &link.beta};
    *members[row % 5] += step;
  } else if (row < rows.tool(0)) {
    Vector6 motion = Vector6::Unit(row - rows.base(0)) * step;
    state.X_WB.translation() += motion.head<3>();
    state.X_WB.linear() = rotation_exp(motion.tail<3>()) * state.X_WB.linear();
  } else if (row < rows.mass()) {
    const Vector6 motion = Vector6::Unit(row - rows.tool(0)) * step;
    state.X_FT = make_pose(rotation_exp(motion.tail<3>()), motion.head<3>()) * state.X_FT;
  } else if (row == rows.mass()) {
    state.payload.mass += step;
  } else if (row < rows.tip(0)) {
    state.payload.p_FoCog_F(row - rows.cog(0)) += step;
  } else if (row < rows.first_moment(0, 0)) {
    state.tip_W(row - rows.tip(0)) += step;
  } else if (row < rows.spring(0)) {
    state.first_moments.reshaped()(row - rows.first_moment(0, 0)) += step;
  } else {
    state.spring_torque(row - rows.spring(0)) += step;
  }
  return state;
}

ArmState loaded_arm(const Chain& chain, std::mt19937_64& random) {
  ArmState state;
  state.chain = &chain;
  state.links = chain.links_at(random_joints(chain.size(), random));
  state.X_WB = make_pose(rotation_exp({0.3, -0.2, 0.5}), {0.4, 0.5, -0.6});
  state.X_FT = make_pose(rotation_exp({-0.4, 0.6, 0.1}), {0.1, 0.05, 0.2});
  state.payload = {80, {0.05, -0.02, 0.15}};
  state.gravity_W = Vector3(0.1, 0.2, -0.9).normalized();
  return state;
}

TEST(ArmKinematics, EveryDerivativeFitsCentralDifferencesToOneInAMillion) {
  std::mt19937_64 random(2);
  for (const Chain& chain : {shipped_chain("abb_irb6640-205-275.yaml"),
                             shipped_chain("universal-robots_ur10.yaml"), odd_arm()}) {
    ArmState state = loaded_arm(chain, random);
    state.first_moments = FirstMoments::Random(2, chain.size());
    state.spring_torque = JointArray::Random(chain.size());
    const ArmKinematics kinematics(state);
    const Eigen::VectorXd deflection = Eigen::VectorXd::LinSpaced(chain.size(), 1e-3, 5e-3);
    const Eigen::MatrixXd J = kinematics.pose_jacobian();
    const Eigen::MatrixXd T = kinematics.gravity_torque_jacobian();
    const Eigen::MatrixXd M = kinematics.base_moment_jacobian();
    const Eigen::MatrixXd D = kinematics.deflection_jacobian_derivative(deflection);
    for (int row = 0; row < StateRows(chain.size()).size(); ++row) {
      constexpr double kStep = 1e-5;
      const ArmKinematics ahead(moved(state, row, kStep));
      const ArmKinematics behind(moved(state, row, -kStep));
      const Vector6 pose_change =
          pose_difference(ahead.tool_pose_W(), behind.tool_pose_W()) / (2 * kStep);
      EXPECT_LT((J.col(row) - pose_change).norm(), 1e-6) << chain.name() << " row " << row;
      const Eigen::VectorXd torque_change =
          (ahead.gravity_torque() - behind.gravity_torque()) / (2 * kStep);
      EXPECT_LT((T.col(row) - torque_change).norm(), 1e-6 * (1 + torque_change.norm()))
          << chain.name() << " row " << row;
      const Vector3 base_change = (ahead.base_moment() - behind.base_moment()) / (2 * kStep);
      EXPECT_LT((M.col(row) - base_change).norm(), 1e-6 * (1 + base_change.norm()))
          << chain.name() << " row " << row;
      const Vector6 deflected_change =
          (ahead.deflection_jacobian() - behind.deflection_jacobian()) * deflection / (2 * kStep);
      EXPECT_LT((D.col(row) - deflected_change).norm(), 1e-6) << chain.name() << " row " << row;
    }
  }
}

TEST(ArmKinematics, TorqueIsTheWorkOfTheWeightPerJointMotion) {
  // Virtual work: tau_j = d(weight . p_cog)/dq_j.
  std::mt19937_64 random(3);
  const Chain chain = shipped_chain("abb_irb6640-205-275.yaml");
  const ArmState state = loaded_arm(chain, random);
  const Eigen::VectorXd torque = ArmKinematics(state).gravity_torque();
  ArmState at_cog = state;
  at_cog.X_FT = make_pose(Matrix3::Identity(), state.payload.p_FoCog_F);
  const Vector3 weight = state.payload.mass * kGravity * state.gravity_W;
  for (int j = 0; j < 6; ++j) {
    const int row = StateRows(6).theta(j);
    const Vector3 ahead = ArmKinematics(moved(at_cog, row, 1e-6)).tool_pose_W().translation();
    const Vector3 behind = ArmKinematics(moved(at_cog, row, -1e-6)).tool_pose_W().translation();
    EXPECT_NEAR(torque(j), weight.dot(ahead - behind) / 2e-6, 1e-4) << "joint " << j + 1;
  }
}

TEST(ArmKinematics, LinksWeighOnTheJointsBeforeThem) {
  // Virtual work again, for a robot whose links weigh: tau_j = sum over bodies of weight .
  // d(cog)/dq_j.
  std::mt19937_64 random(4);
  const Chain heavy = shipped_chain("universal-robots_ur10.yaml");
  ArmState state = loaded_arm(heavy, random);
  state.payload.mass = 0;
  const Eigen::VectorXd torque = ArmKinematics(state).gravity_torque();
  Eigen::VectorXd work = Eigen::VectorXd::Zero(6);
  for (int body = 0; body < 6; ++body) {
    // The link's centre of gravity is the tool point of an arm that ends with that link.
    ArmState cut = state;
    std::vector<Joint> joints;
    for (int i = 0; i <= body; ++i) joints.push_back(heavy.joint(i));
    const Chain shorter = *Chain::make("cut", joints);
    cut.chain = &shorter;
    cut.links.resize(static_cast<std::size_t>(body + 1));
    cut.X_FT = make_pose(Matrix3::Identity(), heavy.joint(body).p_cog);
    for (int j = 0; j <= body; ++j) {
      const Vector3 motion = (ArmKinematics(moved(cut, StateRows(body + 1).theta(j), 1e-6))
                                  .tool_pose_W()
                                  .translation() -
                              ArmKinematics(moved(cut, StateRows(body + 1).theta(j), -1e-6))
                                  .tool_pose_W()
                                  .translation()) /
                             2e-6;
      work(j) += heavy.joint(body).mass * kGravity * state.gravity_W.dot(motion);
    }
  }
  EXPECT_LT((torque - work).norm(), 1e-5 * work.norm());
}

TEST(ArmKinematics, TwoFirstMomentsALinkStandForAllWeightsOfTheLinks) {
  // Told masses, and the first moments that follow from them: what a link carries as one piece.
  std::mt19937_64 random(5);
  const Chain heavy = shipped_chain("universal-robots_ur10.yaml");
  std::vector<Joint> weightless;
  FirstMoments moments = FirstMoments::Zero(2, 6);
  double beyond = 0;
  Vector3 along =
      Vector3::Zero();  // the next link's moment along its own axis, at the far end of this link
  for (int i = 5; i >= 0; --i) {
    const Joint& joint = heavy.joint(i);
    const Matrix3 R = Eigen::AngleAxisd(joint.link.alpha, Vector3::UnitX()).toRotationMatrix();
    const Vector3 to_end(joint.link.a, 0, joint.link.d);
    const Vector3 moment = joint.mass * (to_end + R * joint.p_cog) + beyond * to_end + R * along;
    moments.col(i) = moment.head<2>();
    along = Vector3(0, 0, moment.z());
    beyond += joint.mass;
    weightless.insert(weightless.begin(), joint);
    weightless.front().mass = 0;
  }
  const Chain light = *Chain::make("light", weightless);
  ArmState state = loaded_arm(heavy, random);
  const Eigen::VectorXd torque = ArmKinematics(state).gravity_torque();
  state.chain = &light;
  EXPECT_GT((ArmKinematics(state).gravity_torque() - torque).norm(), 0.05 * torque.norm());
  state.first_moments = moments;
  EXPECT_LT((ArmKinematics(state).gravity_torque() - torque).norm(), 1e-9 * torque.norm());
}

TEST(Chain, RefusesWhatIsNoRobot) {
  Joint joint;
  EXPECT_FALSE(Chain::make("empty", {}));
  joint.lower = 1;
  joint.upper = 1;
  EXPECT_FALSE(Chain::make("no range", {joint}));
  EXPECT_FALSE(Chain::make("coupled to itself", {Joint{}}, {{0, 0, 1.0}}));
  EXPECT_FALSE(Chain::make("coupled to nothing", {Joint{}}, {{0, 1, 1.0}}));
}

TEST(Chain, NamesTheFirstJointOutsideItsLimits) {
  const Chain chain = shipped_chain("abb_irb6640-205-275.yaml");
  JointVector q = JointVector::Zero(6);
  EXPECT_FALSE(chain.joint_outside_limits(q));
  q(2) = from_deg(70.1);
  q(4) = from_deg(-121);
  EXPECT_EQ(chain.joint_outside_limits(q), 2);
  q(2) = std::nan("");
  EXPECT_EQ(chain.joint_outside_limits(q), 2);
}

}  // namespace
}  // namespace trammel
