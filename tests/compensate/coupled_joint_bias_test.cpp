#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/bias/bias_model.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/compensate/bias_physics.h"
#include "server/robot/cell.h"
#include "tests/support/demand.h"

// A bias with maps of joints, on an arm whose joint 3 the controller counts against level.

namespace trammel {
namespace {

constexpr Eigen::Index kPoses = 160, kJoints = 6, kHarmonics = 48;

std::shared_ptr<const Cell> coupled_cell() {
  auto cell = std::make_shared<Cell>();
  cell->robot = test::demand(read_robot(TRAMMEL_SOURCE_DIR "/models/fanuc_m-20ia.yaml"));
  cell->X_WB = Pose::Identity();
  cell->tools["t"] = Pose(Eigen::Translation3d(0.1, 0.05, 0.2));
  return cell;
}

PoseContext at(const JointVector& q) {
  PoseContext context;
  context.q = q;
  context.tool = "t";
  return context;
}

/// The error of gear 3, as the tool shows it. As this robot counts, the gear turns by the sum of
/// joints 2 and 3.
Vector3 shown(const JointVector& q, const BiasFeatures& features) {
  return 3e-4 * std::sin(5 * (q(1) + q(2)) + 1) * features.by_joint.col(2).head<3>();
}

BiasState learned(const BiasPhysics& physics, std::mt19937& random) {
  std::uniform_real_distribution<double> angle(-1, 1);
  BiasState state;
  state.kernel = "se + joint_map";
  state.q = Eigen::MatrixXd::NullaryExpr(kPoses, kJoints, [&] { return angle(random); });
  state.residual_B.resize(kPoses, kCoordinates);
  state.sigma = Eigen::VectorXd::Constant(kPoses, 1e-5);
  state.offset = Eigen::VectorXd::Zero(kCoordinates);
  for (Eigen::Index i = 0; i < kPoses; ++i) {
    const JointVector q = state.q.row(i).transpose();
    state.features.push_back(physics.at(at(q)));
    state.residual_B.row(i) = shown(q, state.features.back()).transpose();
  }
  const Eigen::Index of_kernel =
      test::demand(spelled_bias(state.kernel)).kernel->parameter_count(kJoints);
  state.hyperparameters.setZero(of_kernel + 2, kCoordinates);
  state.hyperparameters.row(of_kernel).setConstant(std::log(1e-6));
  state.hyperparameters.row(of_kernel + 1).setConstant(std::log(1e-5));
  state.block_hyperparameters.resize(3 * kJoints + 1);
  for (Eigen::Index j = 0; j < kJoints; ++j)
    state.block_hyperparameters.segment<3>(3 * j) << std::log(1e-4), std::log(6.0), std::log(2.0);
  state.block_hyperparameters(3 * kJoints) = std::log(static_cast<double>(kHarmonics));
  return state;
}

TEST(CoupledJointBias, AMapOfJointsIsAFunctionOfTheAnglesOfTheirGears) {
  const BiasPhysics physics(test::demand(make_physical_model(coupled_cell(), {})));
  std::mt19937 random(7);
  const BiasModel bias = test::demand(BiasModel::restore(learned(physics, random)));
  std::uniform_real_distribution<double> angle(-1, 1);
  double left = 0, whole = 0;
  for (int i = 0; i < 50; ++i) {
    const JointVector q = JointVector::NullaryExpr(kJoints, [&] { return angle(random); });
    const BiasFeatures features = physics.at(at(q));
    left += (bias.mean_B(q, features) - shown(q, features)).squaredNorm();
    whole += shown(q, features).squaredNorm();
  }
  EXPECT_LT(left, 0.01 * whole);
}

}  // namespace
}  // namespace trammel
