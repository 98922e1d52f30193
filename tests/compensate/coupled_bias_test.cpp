#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "server/base/units.h"
#include "server/compensate/bias_physics.h"
#include "server/compensate/compensated_model.h"
#include "server/compensate/model_file.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/refusal.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

PoseContext posed(const JointVector& q) {
  PoseContext context;
  context.q = q;
  context.tool = context.payload = "spindle";
  context.served = true;
  return context;
}

JointVector joints_inside() {
  JointVector q(6);
  q << 0.1, -0.1, 0.2, 0.2, 0.8, -0.1;
  return q;
}

/// Of up to 200 poses a bias is learned five times more (bias_spread.h): most of the time.
constexpr int kManyPoses = 250;

/// M2 on a robot whose joints give way, with a bias that may learn the missing compliance in the
/// shape of compliance.
class CoupledBias : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    robot_ = new VirtualRobot(test::chapter_5_robot(test::cell_7()));
    model_ = new CompensatedModel(trained("M2", "se + joint_map + parameters", kManyPoses));
  }
  static void TearDownTestSuite() {
    delete robot_;
    delete model_;
  }
  static CompensatedModel trained(const std::string& level, const std::string& bias, int poses) {
    TrainOptions options;
    options.level = level;
    options.bias = bias;
    return test::demand(train(robot_->truth.cell, test::measured(*robot_, poses, 31), options));
  }

  static VirtualRobot* robot_;
  static CompensatedModel* model_;
};

VirtualRobot* CoupledBias::robot_ = nullptr;
CompensatedModel* CoupledBias::model_ = nullptr;

void expect_same(const ErrorPrediction& a, const ErrorPrediction& b) {
  EXPECT_EQ(a.X_BT_predicted.matrix(), b.X_BT_predicted.matrix());
  EXPECT_EQ(a.covariance_B, b.covariance_B);
  EXPECT_EQ(a.true_stddev_B, b.true_stddev_B);
  EXPECT_EQ(a.in_domain, b.in_domain);
}

TEST_F(CoupledBias, IsTheSameAfterItWasStoredBitForBit) {
  const std::string text = serialize(*model_);
  const Result<CompensatedModel> again = deserialize(text, "memory");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->provenance().hash, model_->provenance().hash);
  EXPECT_EQ(serialize(*again), text);
  const MeasurementBatch fresh = test::measured(*robot_, 20, 32);
  for (const Measurement& m : fresh.measurements) {
    expect_same(model_->predict(m.context.q, "spindle", "spindle"),
                again->predict(m.context.q, "spindle", "spindle"));
  }
}

TEST_F(CoupledBias, KeysOfBlocksAreWrittenWhereThereAreBlocksAndTheHashCoversThem) {
  const auto content_of = [](const CompensatedModel& model) {
    return nlohmann::json::parse(serialize(model)).at("content").at("bias");
  };
  const nlohmann::json plain = content_of(trained("M2", "se", 60));
  EXPECT_FALSE(plain.contains("poses"));
  EXPECT_FALSE(plain.contains("block_hyperparameters"));
  EXPECT_EQ(content_of(*model_).at("poses").size(), kManyPoses);

  nlohmann::json file = nlohmann::json::parse(serialize(*model_));
  file["content"]["bias"]["poses"][3]["payload"] = "feather";
  EXPECT_EQ(refusal_of(deserialize(file.dump(), "cell.model")), Refusal("cell.model", {}, "hash"));
  // Even with a fitting hash a pose that the cell cannot have is refused, and so are too few of
  // them.
  file["hash"] = sha256_hex(file["content"].dump());
  EXPECT_EQ(refusal_of(deserialize(file.dump(), "cell.model")),
            Refusal("cell.model", {}, "bias").text("spindle feather"));
  file["content"]["bias"].erase("poses");
  file["hash"] = sha256_hex(file["content"].dump());
  EXPECT_EQ(refusal_of(deserialize(file.dump(), "cell.model")),
            Refusal("cell.model", {}, "bias").beyond(0, kManyPoses));
}

TEST_F(CoupledBias, APoseDescribedAsNoRobotCanBeIsRefused) {
  const auto refusal = [](const auto& spoil) {
    CompensatedModel::Parts parts = model_->parts();
    PoseContext& pose = parts.bias_contexts[3];
    pose.direction = {1, 0, -1, 1, 1, 1};
    pose.velocity = JointVector::Constant(6, 0.1);
    pose.time = pose.temperature = 20;
    pose.before = JointVector::Constant(6, 0.2);
    pose.lagged.assign(kHeatLags.size(), 21);
    spoil(pose);
    const Result<CompensatedModel> made = CompensatedModel::make(std::move(parts));
    return refusal_of(made);
  };
  static constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal([](PoseContext&) {}), Refusal::none());
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.direction.pop_back(); }),
            Refusal("", {}, "direction").beyond(5, 6));
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.direction[2] = 2; }),
            Refusal("", {}, "direction").beyond(2, 1));
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.velocity = JointVector::Zero(5); }),
            Refusal("", {}, "velocity").beyond(5, 6));
  EXPECT_EQ(refusal([](PoseContext& pose) { (*pose.velocity)(1) = kNan; }),
            Refusal("", {}, "velocity"));
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.time = kNan; }), Refusal("", {}, "time"));
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.temperature = kNan; }),
            Refusal("", {}, "temperature"));
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.index = -1; }),
            Refusal("", {}, "index").beyond(-1, 0));
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.before = JointVector::Zero(7); }),
            Refusal("", {}, "before").beyond(7, 6));
  EXPECT_EQ(refusal([](PoseContext& pose) { (*pose.before)(5) = kNan; }),
            Refusal("", {}, "before"));
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.lagged.pop_back(); }),
            Refusal("", {}, "lagged_c").beyond(kHeatLags.size() - 1, kHeatLags.size()));
  EXPECT_EQ(refusal([](PoseContext& pose) { pose.lagged[2] = kNan; }), Refusal("", {}, "lagged_c"));

  nlohmann::json file = nlohmann::json::parse(serialize(*model_));
  file["content"]["bias"]["poses"][3]["velocity"] = {
      {"rows", 3}, {"columns", 2}, {"values", {0, 0, 0, 0, 0, 0}}};
  file["hash"] = sha256_hex(file["content"].dump());
  const Result<CompensatedModel> read = deserialize(file.dump(), "cell.model");
  ASSERT_FALSE(read);
  EXPECT_EQ(refusal_of(read), Refusal("cell.model"));

  constexpr std::int64_t kHuge = std::int64_t{1} << 32;  // whose square overflows to 0
  file["content"]["covariance"] = {
      {"rows", kHuge}, {"columns", kHuge}, {"values", nlohmann::json::array()}};
  file["hash"] = sha256_hex(file["content"].dump());
  const Result<CompensatedModel> huge = deserialize(file.dump(), "cell.model");
  ASSERT_FALSE(huge);
  EXPECT_EQ(refusal_of(huge), Refusal("cell.model"));
}

TEST_F(CoupledBias, WhatCameBeforeAPoseIsKeptInTheModelsFile) {
  CompensatedModel::Parts parts = model_->parts();
  EXPECT_FALSE(parts.bias_contexts[3].before) << "no source asks for it";
  EXPECT_TRUE(parts.bias_contexts[3].lagged.empty());
  parts.bias_contexts[3].before = JointVector::LinSpaced(6, -1, 1);
  for (const double lag : kHeatLags) parts.bias_contexts[3].lagged.push_back(20 + 1 / lag);
  const CompensatedModel model = test::demand(CompensatedModel::make(parts));
  const CompensatedModel read = test::demand(deserialize(serialize(model), "cell.model"));
  EXPECT_EQ(read.parts().bias_contexts[3].before, parts.bias_contexts[3].before);
  EXPECT_EQ(read.parts().bias_contexts[3].lagged, parts.bias_contexts[3].lagged);
}

TEST_F(CoupledBias, WhatComplianceWouldHaveExplainedIsLearnedWithItsShape) {
  const MeasurementBatch fresh = test::measured(*robot_, 300, 33);
  const Evaluation evaluation = model_->evaluate(fresh);
  EXPECT_GT(to_mm(evaluation.calibrated.rms), 1.0);
  EXPECT_LT(to_mm(evaluation.compensated.rms), 0.028) << "the floor is 0.0225";
  EXPECT_GT(evaluation.coverage_95, 0.92);
  EXPECT_LT(evaluation.coverage_95, 0.98);
}

TEST_F(CoupledBias, ManyPosesSayWhatOneSays) {
  std::vector<PoseContext> poses;
  for (const Measurement& m : test::measured(*robot_, 30, 34).measurements)
    poses.push_back(posed(m.context.q));
  const std::vector<ErrorPrediction> many = model_->predict_all(poses);
  for (const std::size_t i : {0u, 17u, 29u}) {
    const ErrorPrediction one = model_->predict(poses[i].q, "spindle", "spindle");
    EXPECT_LT((one.error_B - many[i].error_B).norm(), 1e-13);
    EXPECT_LT((one.covariance_B - many[i].covariance_B).norm(), 1e-9 * one.covariance_B.norm());
  }
}

TEST_F(CoupledBias, TheCovarianceOfAPredictionIsTheBiasOwnAndTheNoise) {
  const ErrorPrediction at = model_->predict(joints_inside(), "spindle", "spindle");
  ASSERT_TRUE(at.in_domain);
  const BiasPrediction bias =
      model_->bias()->predict(joints_inside(), model_->features(posed(joints_inside())));
  const double sigma = model_->cell().tracker.sigma;
  Matrix3 expected = bias.covariance_B;
  expected.diagonal() +=
      (bias.measured_stddev_B.cwiseAbs2() - bias.stddev_B.cwiseAbs2()).cwiseMax(sigma * sigma);
  // The identified parameters' covariance is part of the bias': not added a second time.
  EXPECT_LT((at.covariance_B - expected).norm(), 1e-12 * expected.norm());
  EXPECT_GT(std::abs(at.covariance_B(0, 2)), 1e-4 * at.covariance_B.trace());
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(at.stddev_B[d], std::sqrt(at.covariance_B(d, d)), 1e-15);
    EXPECT_NEAR(std::pow(at.stddev_B[d], 2) - std::pow(at.true_stddev_B[d], 2), sigma * sigma,
                1e-15);
  }
}

TEST(BiasPhysics, AToolThatChangedIsNotTheToolThatNobodyKnows) {
  const auto cell = test::cell_7_unlocated();
  const PhysicalModel without = test::demand(make_physical_model(cell, {"base", "geometry"}));
  const PhysicalModel changed =
      test::demand(make_physical_model(cell, {"base", "geometry", "tool_changed@10"}));
  const auto columns = [](const PhysicalModel& physics) {
    return BiasPhysics(physics).at(posed(joints_inside())).by_parameter.cols();
  };
  EXPECT_EQ(columns(changed), columns(without) + changed.values.size() - without.values.size());
}

TEST_F(CoupledBias, AModelOfBeforeBlocksLastedIsRefusedNotServedOtherwise) {
  nlohmann::json file = nlohmann::json::parse(serialize(*model_));
  file["content"]["bias"].erase("fades");
  file["hash"] = sha256_hex(file["content"].dump());
  EXPECT_EQ(refusal_of(deserialize(file.dump(), "cell.model")), Refusal("cell.model", {}, "bias"));
}

TEST_F(CoupledBias, ACorrectionFarOutSettlesWithTheBlocksAndWithoutTheKernel) {
  CompensatedModel::Parts parts = model_->parts();
  parts.q_max(0) = parts.q_min(0) + 0.1;  // as if joint 1 had hardly moved
  const CompensatedModel model = test::demand(CompensatedModel::make(std::move(parts)));
  const JointVector far = joints_inside();
  const ErrorPrediction at = model.predict(far, "spindle", "spindle");
  EXPECT_EQ(at.bias_weight, 0);
  EXPECT_FALSE(at.in_domain);
  const BiasPrediction bias = model_->bias()->predict(far, model_->features(posed(far)));
  const PhysicalModel& physics = model_->parts().physics;
  const Vector3 calibrated = physics.X_WB.inverse() * physics.pose_W(posed(far)).translation();
  EXPECT_LT((at.X_BT_predicted.translation() - calibrated - bias.mean_B + bias.nearby_B).norm(),
            1e-12);
  EXPECT_GT(to_mm((bias.mean_B - bias.nearby_B).norm()), 0.3);
  Target target;
  target.joint_target = true;
  target.seed = far;
  const Correction correction = model.correct(target, "spindle", "spindle");
  EXPECT_EQ(correction.status, CorrectionStatus::kOutOfDomain);
  EXPECT_LT(correction.left, 1e-7);
  EXPECT_NE(correction.message.find("the blocks of the bias and 0 % of its kernel"),
            std::string::npos)
      << correction.message;
  const Vector3 reached = robot_->truth.pose_W(posed(correction.q)).translation();
  EXPECT_LT(to_mm((reached - correction.X_BT_wanted.translation()).norm()), 0.15);
}

TEST_F(CoupledBias, AMapOfJoint2IsUsedWhereJoint2WasMeasuredThoughJoint1IsFarOut) {
  const auto map_of_2 = [](const PoseContext& at) {
    return Vector3(3e-4 * std::sin(5 * at.q(1) + 1) *
                   model_->features(at).by_joint.col(1).head<3>());
  };
  // Learned from the poses on one side of joint 1 only.
  CompensatedModel::Parts parts = model_->parts();
  std::vector<Eigen::Index> rows;
  std::vector<PoseContext> contexts;
  for (Eigen::Index i = 0; i < parts.bias->q.rows(); ++i) {
    PoseContext at = parts.bias_contexts[static_cast<std::size_t>(i)];
    at.q = parts.bias->q.row(i).transpose();
    parts.bias->residual_B.row(i) += map_of_2(at).transpose();
    if (at.q(0) > 0) continue;
    rows.push_back(i);
    contexts.push_back(at);
  }
  parts.bias->q = parts.bias->q(rows, Eigen::all).eval();
  parts.bias->residual_B = parts.bias->residual_B(rows, Eigen::all).eval();
  parts.bias->sigma = parts.bias->sigma(rows).eval();
  parts.bias->block_hyperparameters.segment<3>(3) << std::log(3e-4), std::log(6.0), std::log(2.0);
  parts.bias_contexts = contexts;
  parts.rotation_bias.reset();
  parts.q_max(0) = 0;
  const CompensatedModel model = test::demand(CompensatedModel::make(std::move(parts)));
  double left = 0, of_map = 0;
  int far = 0, inside = 0;
  for (const Measurement& m : test::measured(*robot_, 300, 36).measurements) {
    const PoseContext at = posed(m.context.q);
    const ErrorPrediction predicted = model.predict(at.q, "spindle", "spindle");
    if (predicted.bias_weight > 0) continue;
    ++far;
    EXPECT_FALSE(predicted.in_domain);
    const Vector3 true_B =
        model.parts().physics.X_WB.inverse() * robot_->truth.pose_W(at).translation() +
        map_of_2(at);
    const Vector3 error_B = true_B - predicted.X_BT_predicted.translation();
    left += error_B.squaredNorm();
    of_map += map_of_2(at).squaredNorm();
    inside +=
        static_cast<int>((error_B.array().abs() <= 1.96 * predicted.true_stddev_B.array()).count());
  }
  ASSERT_GT(far, 50);
  EXPECT_GT(to_mm(std::sqrt(of_map / far)), 0.2);
  EXPECT_LT(left, 0.1 * of_map);
  EXPECT_GT(inside, 0.85 * 3 * far);
}

TEST_F(CoupledBias, WhatFirstOrderLeavesOutGrowsWithTheSquare) {
  const BiasPhysics physics(model_->parts().physics);
  const Eigen::VectorXd found = model_->bias()->parameter_weights();
  ASSERT_EQ(found.size(), 36);
  const Vector3 once = physics.beyond_first_order(posed(joints_inside()), 0.01 * found);
  const Vector3 twice = physics.beyond_first_order(posed(joints_inside()), 0.02 * found);
  EXPECT_GT(once.norm(), 1e-11);
  EXPECT_LT((twice - 4 * once).norm(), 0.05 * twice.norm());
}

TEST_F(CoupledBias, FeaturesAreHowTheRealArmMovesTheTool) {
  const PhysicalModel& physics = model_->parts().physics;
  const BiasFeatures features = model_->features(posed(joints_inside()));
  ASSERT_EQ(features.by_joint.cols(), 6);
  ASSERT_EQ(features.by_parameter.cols(), 36)
      << "base, geometry, and compliance, which the model lacks";
  const auto pose_B = [&](const JointVector& q) {
    return physics.X_WB.inverse() * physics.pose_W(posed(q));
  };
  const double h = 1e-5;
  for (Eigen::Index j = 0; j < 6; ++j) {
    JointVector up = joints_inside(), down = joints_inside();
    up(j) += h;
    down(j) -= h;
    const Vector6 moved = pose_difference(pose_B(up), pose_B(down)) / (2 * h);
    EXPECT_LT((features.by_joint.col(j) - moved).norm(), 1e-6) << "joint " << j + 1;
  }
  // A first parameter of the base: x0, 2 mm of prior.
  EXPECT_NEAR(features.by_parameter.col(0).head(3).norm(), 2e-3, 1e-12);
  // The effect of the compliance of joint 3, beside a model that has it.
  const PhysicalModel with =
      test::demand(make_physical_model(robot_->truth.cell, {"base", "geometry", "compliance"}));
  PhysicalModel soft = with;
  soft.values.head(30) = physics.values;
  soft.values.tail(6).setZero();
  PhysicalModel softer = soft;
  softer.values(32) = 1e-3 * with.parameters()[32].prior_scale;
  const Vector6 moved =
      pose_difference(softer.pose_W(posed(joints_inside())), soft.pose_W(posed(joints_inside()))) /
      1e-3;
  EXPECT_GT(moved.head(3).norm(), 1e-4);
  EXPECT_LT((features.by_parameter.col(32) - moved).norm(), 1e-3 * moved.norm());
}

TEST_F(CoupledBias, CorrectedTargetsLandWhereTheyWereWanted) {
  for (const Measurement& m : test::measured(*robot_, 10, 35).measurements) {
    Target target;
    target.X_BT = robot_->truth.nominal_pose_W(posed(m.context.q));
    target.seed = m.context.q;
    const Correction correction = model_->correct(target, "spindle", "spindle");
    if (correction.status != CorrectionStatus::kOk) continue;
    const Vector3 reached = robot_->truth.pose_W(posed(correction.q)).translation();
    EXPECT_LT(to_mm((reached - target.X_BT.translation()).norm()), 0.05);
  }
}

}  // namespace
}  // namespace trammel
