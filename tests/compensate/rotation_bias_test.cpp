#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "server/base/units.h"
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

BiasModel turning_of(const CompensatedModel& model) {
  BiasState state = *model.parts().rotation_bias;
  for (Eigen::Index i = 0; i < state.q.rows(); ++i) {
    PoseContext context = model.parts().bias_contexts[static_cast<std::size_t>(i)];
    context.q = state.q.row(i).transpose();
    state.features.push_back(turned(model.features(context)));
  }
  return test::demand(BiasModel::restore(state));
}

/// Of up to 200 poses a bias is learned five times more (bias_spread.h): most of the time.
constexpr int kManyOriented = 300;

/// A robot whose wrist turns the tool wrongly by what no identified source knows.
class RotationBias : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    robot_ = new VirtualRobot(test::chapter_5_robot(test::cell_7()));
    for (const char* spec : {"joint_map:4@3", "joint_map:5@4", "joint_map:6@5"}) {
      const ErrorSourcePtr map = test::demand(make_error_source(spec, *robot_->truth.cell));
      const Eigen::Index first = add_source(robot_->truth, map);
      robot_->truth.values.segment(first, static_cast<Eigen::Index>(map->parameters().size()))
          .setConstant(3e-4);
    }
    batch_ = new MeasurementBatch(test::measured(*robot_, kManyOriented, 71));
    model_ = new CompensatedModel(trained(*batch_, "se + joint_map"));
  }
  static void TearDownTestSuite() {
    delete robot_;
    delete batch_;
    delete model_;
  }
  static CompensatedModel trained(const MeasurementBatch& batch, const std::string& bias) {
    TrainOptions options;
    options.level = "M3";
    options.bias = bias;
    return test::demand(train(robot_->truth.cell, batch, options));
  }
  /// The true rotation angle of corrected targets to the pose wanted, rms, rad.
  static double true_turn_after(const CompensatedModel& model) {
    double sum = 0;
    int count = 0;
    for (const Measurement& m : test::measured(*robot_, 60, 72).measurements) {
      Target target;
      target.joint_target = true;
      target.seed = m.context.q;
      const Correction correction = model.correct(target, "spindle", "spindle");
      if (correction.status != CorrectionStatus::kOk) continue;
      const Pose reached = robot_->truth.X_WB.inverse() * robot_->truth.pose_W(posed(correction.q));
      sum += rotation_log(correction.X_BT_wanted.linear() * reached.linear().transpose())
                 .squaredNorm();
      ++count;
    }
    EXPECT_GT(count, 40);
    return std::sqrt(sum / count);
  }

  static VirtualRobot* robot_;
  static MeasurementBatch* batch_;
  static CompensatedModel* model_;
};

VirtualRobot* RotationBias::robot_ = nullptr;
MeasurementBatch* RotationBias::batch_ = nullptr;
CompensatedModel* RotationBias::model_ = nullptr;

TEST_F(RotationBias, TheExpectedErrorsOfTheOrientationAreThoseThatAreFound) {
  double before = 0, after = 0, expected_before = 0, expected_after = 0;
  const auto turn_to = [](const Correction& correction, const JointVector& q) {
    const Pose X_BT = robot_->truth.X_WB.inverse() * robot_->truth.pose_W(posed(q));
    return rotation_log(correction.X_BT_wanted.linear() * X_BT.linear().transpose()).squaredNorm();
  };
  for (const Measurement& m : test::measured(*robot_, 80, 74).measurements) {
    Target target;
    target.joint_target = true;
    target.seed = m.context.q;
    const Correction correction = model_->correct(target, "spindle", "spindle");
    if (correction.status != CorrectionStatus::kOk) continue;
    before += turn_to(correction, m.context.q);
    after += turn_to(correction, correction.q);
    expected_before += correction.turn_before * correction.turn_before;
    expected_after += correction.turn_after * correction.turn_after;
  }
  EXPECT_NEAR(std::sqrt(before / expected_before), 1, 0.1);
  EXPECT_NEAR(std::sqrt(after / expected_after), 1, 0.35);
}

TEST_F(RotationBias, TheTrueOrientationOfCorrectedTargetsIsNearerAndTheIntervalsHold) {
  ASSERT_TRUE(model_->parts().rotation_bias);
  const double calibrated = true_turn_after(trained(*batch_, "none"));
  const double compensated = true_turn_after(*model_);
  EXPECT_GT(calibrated, 5e-4);
  EXPECT_LT(compensated, 0.2 * calibrated);
  const Evaluation evaluation = model_->evaluate(test::measured(*robot_, 300, 73));
  ASSERT_TRUE(evaluation.orientation);
  EXPECT_EQ(evaluation.orientation->poses, 300);
  EXPECT_LT(evaluation.orientation->compensated, 0.3 * evaluation.orientation->calibrated);
  EXPECT_NEAR(evaluation.orientation->coverage_95.value(), 0.95, 0.03);
}

TEST_F(RotationBias, FadesAwayWithThatOfThePositionButForItsBlocks) {
  const PoseContext far =
      posed(model_->parts().q_max + 0.5 * (model_->parts().q_max - model_->parts().q_min));
  const auto turn_beyond_calibrated = [&](const CompensatedModel& model) {
    const ErrorPrediction prediction = model.predict(far.q, "spindle", "spindle");
    EXPECT_EQ(prediction.bias_weight, 0.0);
    const PhysicalModel& physics = model.parts().physics;
    const Matrix3 calibrated = (physics.X_WB.inverse() * physics.pose_W(far)).linear();
    return rotation_log(prediction.X_BT_predicted.linear() * calibrated.transpose());
  };
  EXPECT_LT(turn_beyond_calibrated(trained(*batch_, "se")).norm(), 1e-14);
  const BiasPrediction turn = turning_of(*model_).predict(far.q, turned(model_->features(far)));
  EXPECT_LT((turn_beyond_calibrated(*model_) - (turn.mean_B - turn.nearby_B)).norm(), 1e-12);
  EXPECT_GT((turn.mean_B - turn.nearby_B).norm(), 1e-5);
}

TEST_F(RotationBias, PredictionsAndCorrectionsTakeTheSamePartOfBothBiases) {
  const BiasModel turning = turning_of(*model_);
  const PhysicalModel& physics = model_->parts().physics;
  const auto with_part = [&](const JointVector& q, double weight) {
    const BiasFeatures features = model_->features(posed(q));
    const BiasPrediction move = model_->bias()->predict(q, features);
    const BiasPrediction turn = turning.predict(q, turned(features));
    Pose X_BT = physics.X_WB.inverse() * physics.pose_W(posed(q));
    X_BT.translation() += move.mean_B - (1 - weight) * move.nearby_B;
    X_BT.linear() =
        (rotation_exp(turn.mean_B - (1 - weight) * turn.nearby_B) * X_BT.linear()).eval();
    EXPECT_GT(turn.nearby_B.norm(), 1e-7);
    return X_BT;
  };
  JointVector q(6);
  q << 0.1, -0.1, 0.2, 0.2, 0.8, -0.1;
  for (const auto& [beyond, weight] : {std::pair{0.0, 1.0}, {0.15, 0.5}, {0.5, 0.0}}) {
    CompensatedModel::Parts parts = model_->parts();
    parts.q_max(0) = parts.q_min(0) +
                     (q(0) - parts.q_min(0)) / (1 + beyond);  // as if joint 1 had not come so far
    const CompensatedModel model = test::demand(CompensatedModel::make(std::move(parts)));
    const ErrorPrediction at = model.predict(q, "spindle", "spindle");
    EXPECT_NEAR(at.bias_weight, weight, 0.05);
    const Vector6 differs = pose_difference(at.X_BT_predicted, with_part(q, at.bias_weight));
    EXPECT_LT(differs.cwiseAbs().maxCoeff(), 1e-12) << weight;
    Target target;
    target.joint_target = true;
    target.seed = q;
    const Correction correction = model.correct(target, "spindle", "spindle");
    const Vector6 left =
        pose_difference(correction.X_BT_wanted, with_part(correction.q, at.bias_weight));
    EXPECT_LT(left.head<3>().norm(), 1e-7) << weight;
    EXPECT_LT(left.tail<3>().norm(), 1e-7) << weight;
  }
}

TEST_F(RotationBias, FarOutATurnMayBeMissedByAsMuchAsThereWasToLearn) {
  const PoseContext far =
      posed(model_->parts().q_max + 0.5 * (model_->parts().q_max - model_->parts().q_min));
  const BiasModel turning = turning_of(*model_);
  const BiasPrediction turn = turning.predict(far.q, turned(model_->features(far)));
  const PhysicalModel& physics = model_->parts().physics;
  Eigen::MatrixXd J_W;
  physics.pose_W(far, physics.values, &J_W);
  const Eigen::MatrixXd J_B = physics.X_WB.linear().transpose() * J_W.bottomRows<3>();
  const Vector3 identified = (J_B * model_->parts().covariance * J_B.transpose()).diagonal();
  const double instrument = model_->cell().tracker.sigma_rotation;
  const Vector3 noise = (turn.measured_stddev_B.cwiseAbs2() - turn.stddev_B.cwiseAbs2())
                            .cwiseMax(instrument * instrument);
  const Vector3 learned =
      turning.state().residual_B.colwise().squaredNorm() / turning.state().q.rows();
  const ErrorPrediction prediction = model_->predict(far.q, "spindle", "spindle");
  ASSERT_EQ(prediction.bias_weight, 0.0);
  const Vector3 expected =
      turn.stddev_B.cwiseAbs2() + identified + noise + learned.cwiseMax(turn.nearby_B.cwiseAbs2());
  EXPECT_LT((prediction.rotation_stddev_B->cwiseAbs2() - expected).norm(), 1e-9 * expected.norm());
  EXPECT_GT(std::sqrt(learned.sum()), 3e-4);
}

TEST_F(RotationBias, IsTheSameAfterItWasStoredBitForBitAndTheHashCoversIt) {
  const Result<CompensatedModel> again = deserialize(serialize(*model_), "memory");
  ASSERT_TRUE(again) << again.error().message;
  for (const Measurement& m : test::measured(*robot_, 20, 74).measurements) {
    const ErrorPrediction a = model_->predict(m.context.q, "spindle", "spindle");
    const ErrorPrediction b = again->predict(m.context.q, "spindle", "spindle");
    EXPECT_EQ(a.X_BT_predicted.matrix(), b.X_BT_predicted.matrix());
    EXPECT_EQ(a.rotation_stddev_B.value(), b.rotation_stddev_B.value());
  }
  nlohmann::json file = nlohmann::json::parse(serialize(*model_));
  file["content"].erase("rotation_bias");
  EXPECT_EQ(refusal_of(deserialize(file.dump(), "cell.model")), Refusal("cell.model", {}, "hash"));
  // As a model is written that learned positions alone.
  file["self_test"] = nlohmann::json::array();
  file["self_test_hash"] = sha256_hex(file["self_test"].dump());
  file["hash"] = sha256_hex(file["content"].dump());
  const CompensatedModel old = test::demand(deserialize(file.dump(), "cell.model"));
  const ErrorPrediction a =
      model_->predict(batch_->measurements[0].context.q, "spindle", "spindle");
  const ErrorPrediction b = old.predict(batch_->measurements[0].context.q, "spindle", "spindle");
  EXPECT_EQ(a.X_BT_predicted.translation(), b.X_BT_predicted.translation());
  EXPECT_EQ(a.covariance_B, b.covariance_B);
  EXPECT_FALSE(b.rotation_stddev_B);
}

TEST_F(RotationBias, IsLearnedOnlyWhereEveryPoseHasAnOrientation) {
  MeasurementBatch partly = *batch_;
  partly.measurements.resize(60);
  const CompensatedModel full = trained(partly, "se");
  EXPECT_TRUE(full.parts().rotation_bias);
  EXPECT_EQ(full.parts().oriented_poses, 0);
  partly.measurements[7].R_WT.reset();
  const CompensatedModel most = trained(partly, "se");
  EXPECT_FALSE(most.parts().rotation_bias);
  EXPECT_EQ(most.parts().oriented_poses, 59);
  EXPECT_EQ(test::demand(deserialize(serialize(most), "memory")).parts().oriented_poses, 59);
  for (Measurement& m : partly.measurements) m.R_WT.reset();
  const CompensatedModel none = trained(partly, "se");
  EXPECT_FALSE(none.parts().rotation_bias);
  EXPECT_EQ(none.parts().oriented_poses, 0);
  EXPECT_FALSE(none.evaluate(partly).orientation);
}

}  // namespace
}  // namespace trammel
