#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/compensate/model_file.h"
#include "server/plan/plan.h"
#include "server/robot/cell_file.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

/// One flange, four reflectors: three are measured, the fourth never is.
namespace trammel {
namespace {

constexpr const char* kCell = R"(version: 1
cell: reflectors
robot: robot.yaml
base: {xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}
gravity: [0, 0, -1]
tools:
  a: {xyz_mm: [140, 0, 60]}
  b: {xyz_mm: [-70, 120, 90]}
  c: {xyz_mm: [-70, -120, 40]}
  fourth: {xyz_mm: [80, -60, 240]}
payloads:
  plate: {mass_kg: 100, cog_mm: [0, 0, 100]}
  feather: {mass_kg: 1, cog_mm: [0, 0, 100]}
tracker: {sigma_mm: 0.013, sigma_deg: 0.0035}
model: {error_sources: [base], bias: none}
joint_ranges_deg: {q1: [-40, 40], q2: [-15, 45], q3: [-15, 45], q4: [-80, 80], q5: [-90, 90], q6: [-80, 80]}
)";

class FlangeBias : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    const auto cell = std::make_shared<const Cell>(
        test::demand(parse_cell(kCell, test::cell_7()->robot_yaml, "cell.yaml")));
    robot_ = new VirtualRobot(test::chapter_5_robot(cell));
    three_ = new CompensatedModel(trained({"a", "b", "c"}, "se + flange"));
    one_ = new CompensatedModel(trained({"a"}, "se + flange"));
  }
  static void TearDownTestSuite() {
    delete robot_;
    delete three_;
    delete one_;
  }

  static MeasurementBatch measured(const std::vector<std::string>& tools, int poses,
                                   std::uint64_t seed, bool noise) {
    const Eigen::MatrixXd q = test::demand(plan_poses(*robot_->truth.cell, {poses, seed}));
    std::vector<PoseContext> contexts;
    for (Eigen::Index i = 0; i < q.rows(); ++i) {
      for (const std::string& tool : tools) {
        contexts.emplace_back();
        contexts.back().q = q.row(i).transpose();
        contexts.back().tool = tool;
        contexts.back().payload = "plate";
      }
    }
    SimulateOptions options;
    options.seed = seed;
    options.orientation = false;
    options.noise = noise;
    MeasurementBatch batch = test::demand(simulate(*robot_, contexts, options));
    batch.id = "reflectors";
    return batch;
  }

  // Only the base is identified: all else that the robot has wrong is left to the bias.
  static CompensatedModel trained(const std::vector<std::string>& tools, const std::string& bias) {
    TrainOptions options;
    options.level = "M1";
    options.bias = bias;
    return test::demand(train(robot_->truth.cell, measured(tools, 100, 3, true), options));
  }

  struct Missed {
    double compensated = 0, calibrated = 0, inside = 0, stddev = 0;
  };
  static Missed missed(const CompensatedModel& model, const std::string& tool) {
    const MeasurementBatch fresh = measured({tool}, 300, 99, false);
    const CompensatedModel::LevelErrors errors = model.errors_B(fresh);
    Missed missed;
    missed.compensated = std::sqrt(errors.compensated.squaredNorm() / 300);
    missed.calibrated = std::sqrt(errors.calibrated.squaredNorm() / 300);
    missed.stddev = std::sqrt(errors.stddev.squaredNorm() / 300);
    missed.inside = static_cast<double>(
                        (errors.compensated.array().abs() < 1.96 * errors.stddev.array()).count()) /
                    900;
    return missed;
  }

  static VirtualRobot* robot_;
  static CompensatedModel* three_;
  static CompensatedModel* one_;
};

VirtualRobot* FlangeBias::robot_ = nullptr;
CompensatedModel* FlangeBias::three_ = nullptr;
CompensatedModel* FlangeBias::one_ = nullptr;

TEST_F(FlangeBias, AReflectorThatWasNeverMeasuredIsPredictedAsWellAsByItsOwnTraining) {
  const Missed by_three = missed(*three_, "fourth");
  const Missed by_itself = missed(trained({"fourth"}, "se"), "fourth");
  EXPECT_LT(by_three.compensated, 1.1 * by_itself.compensated);
  EXPECT_LT(by_three.compensated, 0.3 * by_three.calibrated);
  EXPECT_GT(by_three.inside, 0.9);
}

TEST_F(FlangeBias, OfOneReflectorAnotherIsLessSureAndHonest) {
  const Missed known = missed(*one_, "a");
  const Missed other = missed(*one_, "fourth");
  EXPECT_GT(other.stddev, 1.5 * known.stddev);
  EXPECT_GT(other.inside, 0.9);
  EXPECT_LT(missed(*three_, "fourth").stddev, 0.6 * other.stddev);
}

TEST_F(FlangeBias, HoldsForToolsOfTheCellThatCarryATrainedPayload) {
  EXPECT_TRUE(three_->check_trained_with("fourth", "plate").has_value());
  EXPECT_FALSE(three_->check_trained_with("fourth", "feather").has_value());
  EXPECT_FALSE(three_->check_trained_with("fifth", "plate").has_value());
  EXPECT_FALSE(trained({"a"}, "se").check_trained_with("fourth", "plate").has_value());
}

TEST_F(FlangeBias, CorrectsTheToolThatWasNeverMeasured) {
  const MeasurementBatch fresh = measured({"fourth"}, 20, 7, false);
  for (const Measurement& m : fresh.measurements) {
    Target target;
    target.joint_target = true;
    target.seed = m.context.q;
    const Correction corrected = three_->correct(target, "fourth", "plate");
    if (corrected.status != CorrectionStatus::kOk) continue;
    PoseContext commanded = m.context;
    commanded.q = corrected.q;
    const Pose X_BT = robot_->truth.X_WB.inverse() * robot_->truth.pose_W(commanded);
    const double after = (X_BT.translation() - corrected.X_BT_wanted.translation()).norm();
    EXPECT_LT(after, 5 * std::max(corrected.error_after, 1e-5)) << m.pose_id;
  }
}

TEST_F(FlangeBias, IsTheSameAfterItWasStoredBitForBit) {
  const std::string text = serialize(*three_);
  const Result<CompensatedModel> again = deserialize(text, "memory");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(serialize(*again), text);
  for (const Measurement& m : measured({"fourth"}, 10, 8, false).measurements) {
    const ErrorPrediction before = three_->predict(m.context.q, "fourth", "plate");
    const ErrorPrediction after = again->predict(m.context.q, "fourth", "plate");
    EXPECT_EQ(before.X_BT_predicted.matrix(), after.X_BT_predicted.matrix());
    EXPECT_EQ(before.covariance_B, after.covariance_B);
    EXPECT_EQ(before.in_domain, after.in_domain);
  }
}

TEST_F(FlangeBias, AutoTakesItWhereSeveralReflectorsAreMeasured) {
  const CompensatedModel chosen = trained({"a", "b", "c"}, "auto");
  ASSERT_TRUE(chosen.parts().bias_choice.has_value());
  EXPECT_TRUE(chosen.parts().bias_choice->kernel.find("flange") != std::string::npos ||
              chosen.parts().bias_choice->kernel.find("parameters") != std::string::npos)
      << chosen.parts().bias_choice->sentence;
  const auto& candidates = chosen.parts().bias_choice->candidates;
  EXPECT_TRUE(std::any_of(candidates.begin(), candidates.end(),
                          [](const BiasCandidate& one) { return one.kernel == "se + flange"; }));
}

}  // namespace
}  // namespace trammel
