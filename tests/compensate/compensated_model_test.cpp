#include "server/compensate/compensated_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/robot/inverse_kinematics.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/refusal.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

/// M2 on a robot whose joints give way, in the 6 dim (s) range of Table 5.3, so that the bias has
/// something to learn and the domain an outside.
class Compensated : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    auto cell = std::make_shared<Cell>(*test::cell_7());
    cell->joint_ranges = small_range();
    robot_ = new VirtualRobot(test::chapter_5_robot(cell));
    TrainOptions options;
    options.level = "M2";
    options.bias = "se";
    model_ =
        new CompensatedModel(test::demand(train(cell, test::measured(*robot_, 200, 31), options)));
  }
  static void TearDownTestSuite() {
    delete robot_;
    delete model_;
  }

  static std::vector<std::pair<double, double>> small_range() {
    const auto deg = [](double low, double high) {
      return std::pair{from_deg(low), from_deg(high)};
    };
    return {deg(-15, 15), deg(-15, 15), deg(-15, 30), deg(-30, 30), deg(30, 60), deg(-30, 30)};
  }

  /// Where the virtual robot's tool really goes.
  static Pose true_pose_B(const JointVector& q) {
    PoseContext context;
    context.q = q;
    context.tool = context.payload = "spindle";
    return robot_->truth.pose_W(context);  // cell-7: B stands in W's origin
  }

  static Target target_at(const JointVector& q) {
    PoseContext context;
    context.q = q;
    context.tool = context.payload = "spindle";
    Target target;
    target.X_BT = robot_->truth.nominal_pose_W(context);
    target.seed = q;
    return target;
  }

  static const CompensatedModel& model() { return *model_; }
  static Correction correct(const Target& target) {
    return model_->correct(target, "spindle", "spindle");
  }

  static VirtualRobot* robot_;
  static CompensatedModel* model_;
};

VirtualRobot* Compensated::robot_ = nullptr;
CompensatedModel* Compensated::model_ = nullptr;

JointVector inside() {
  JointVector q(6);
  q << 0.1, -0.1, 0.2, 0.2, 0.8, -0.1;
  return q;
}

TEST_F(Compensated, PredictsTheErrorOfPosesItNeverSaw) {
  const Evaluation evaluation = model().evaluate(test::measured(*robot_, 300, 32));
  EXPECT_GT(to_mm(evaluation.nominal.rms), 3);
  EXPECT_LT(evaluation.compensated.rms, 0.5 * evaluation.calibrated.rms);
  EXPECT_LT(to_mm(evaluation.compensated.rms), 0.07);
  EXPECT_GT(evaluation.coverage_95, 0.90);
  EXPECT_GE(evaluation.in_domain, 280);
}

TEST_F(Compensated, TheLogDensityOfItsErrorsIsThatOfItsOwnStddevs) {
  const MeasurementBatch batch = test::measured(*robot_, 60, 34);
  const CompensatedModel::LevelErrors errors = model().errors_B(batch);
  double sum = 0;
  for (Eigen::Index i = 0; i < errors.stddev.size(); ++i) {
    const double s = errors.stddev(i);
    sum += std::log(std::exp(-0.5 * std::pow(errors.compensated(i) / s, 2)) /
                    (s * std::sqrt(8 * std::atan(1.0))));
  }
  const Evaluation evaluation = model().evaluate(batch);
  EXPECT_NEAR(*evaluation.nlpd, -sum / static_cast<double>(errors.stddev.size()), 1e-9);
  // A coordinate that spreads by s has entropy log(s sqrt(2 pi e)).
  EXPECT_NEAR(nlpd_in_mm(*evaluation.nlpd),
              std::log(to_mm(evaluation.compensated.rms) / std::sqrt(3)) + 1.42, 0.4);
}

TEST_F(Compensated, AModelFileOfBeforeTheLogDensityWasKeptLoads) {
  CompensatedModel::Parts parts = model().parts();
  ASSERT_TRUE(parts.training.nlpd);
  parts.training.nlpd.reset();
  const CompensatedModel old = CompensatedModel::make(std::move(parts)).value();
  const Result<CompensatedModel> loaded = deserialize(serialize(old), "memory");
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_EQ(loaded->provenance().hash, old.provenance().hash);
  EXPECT_FALSE(loaded->parts().training.nlpd);
  EXPECT_EQ(*deserialize(serialize(model()), "memory")->parts().training.nlpd,
            *model().parts().training.nlpd);
}

TEST_F(Compensated, CorrectedTargetsLandWhereTheyWereWanted) {
  const MeasurementBatch poses = test::measured(*robot_, 50, 33);
  for (const Measurement& m : poses.measurements) {
    const Target target = target_at(m.context.q);
    const Correction correction = correct(target);
    if (correction.status == CorrectionStatus::kOutOfDomain) continue;
    ASSERT_EQ(correction.status, CorrectionStatus::kOk) << correction.message;
    EXPECT_LE(correction.iterations, 10);
    EXPECT_LT(correction.left, 1e-7);
    const double before =
        (true_pose_B(m.context.q).translation() - target.X_BT.translation()).norm();
    const double after =
        (true_pose_B(correction.q).translation() - target.X_BT.translation()).norm();
    EXPECT_GT(to_mm(before), 1);
    EXPECT_LT(to_mm(after), 0.15);
    EXPECT_NEAR(correction.error_before, before, 0.15e-3);
    // The commanded pose is what the nominal controller turns into these joints.
    EXPECT_LT(pose_difference(correction.X_BT_commanded, target_at(correction.q).X_BT).norm(),
              1e-8);
  }
}

TEST_F(Compensated, AJointTargetIsTheNominalPoseOfItsJoints) {
  Target target;
  target.joint_target = true;
  target.seed = inside();
  const Correction by_joints = correct(target);
  const Correction by_pose = correct(target_at(inside()));
  ASSERT_EQ(by_joints.status, CorrectionStatus::kOk);
  EXPECT_LT((by_joints.q - by_pose.q).norm(), 1e-8);
}

TEST_F(Compensated, ABranchLeadsToTheSameCorrectionAsASeedInIt) {
  Target target = target_at(inside());
  const Correction by_seed = correct(target);
  target.conf = *branch_of(model().cell().robot, inside());
  target.seed.reset();
  const Correction by_branch = correct(target);
  ASSERT_EQ(by_branch.status, CorrectionStatus::kOk) << by_branch.message;
  EXPECT_LT((by_branch.q - by_seed.q).norm(), 1e-8);
}

TEST_F(Compensated, OutsideTheDomainItFallsBackToTheCalibratedModelAndSaysSo) {
  JointVector far = inside();
  far(0) = from_deg(100);
  const ErrorPrediction prediction = model().predict(far, "spindle", "spindle");
  EXPECT_FALSE(prediction.in_domain);
  PoseContext context;
  context.q = far;
  context.tool = context.payload = "spindle";
  EXPECT_LT(
      pose_difference(prediction.X_BT_predicted, model().parts().physics.pose_W(context)).norm(),
      1e-9);
  EXPECT_GT(to_mm(prediction.error_B.norm()), 0.5);  // never a silent zero
  EXPECT_GT(prediction.stddev_B.norm(),
            3 * model().predict(inside(), "spindle", "spindle").stddev_B.norm());
  const Correction correction = correct(target_at(far));
  EXPECT_EQ(correction.status, CorrectionStatus::kOutOfDomain);
  EXPECT_LT(correction.left, 1e-7);  // corrected all the same, by physics alone
  EXPECT_LT((true_pose_B(correction.q).translation() - correction.X_BT_wanted.translation()).norm(),
            correction.error_before);
}

/// Along joint 1 from inside to far outside (range: 15 deg), in `steps` steps.
std::vector<ErrorPrediction> on_the_way_out(const CompensatedModel& model, int steps) {
  std::vector<ErrorPrediction> predictions;
  for (int k = 0; k <= steps; ++k) {
    JointVector q = inside();
    q(0) = from_deg(10 + 30.0 * k / steps);
    predictions.push_back(model.predict(q, "spindle", "spindle"));
  }
  return predictions;
}

/// The largest change between neighbours, m.
double largest_step(const std::vector<ErrorPrediction>& predictions,
                    Vector3 ErrorPrediction::*what) {
  double largest = 0;
  for (std::size_t k = 1; k < predictions.size(); ++k) {
    largest = std::max(largest, (predictions[k].*what - predictions[k - 1].*what).norm());
  }
  return largest;
}

TEST_F(Compensated, TheBiasFadesOnTheWayOutOfTheDomainWithoutAJump) {
  const auto coarse = on_the_way_out(model(), 300);
  const auto fine = on_the_way_out(model(), 3000);
  EXPECT_EQ(coarse.front().bias_weight, 1);
  EXPECT_TRUE(coarse.front().in_domain);
  EXPECT_EQ(coarse.back().bias_weight, 0);
  EXPECT_FALSE(coarse.back().in_domain);
  // A tenth of the way makes a tenth of the change; a jump would stay as large as it is.
  for (const auto what : {&ErrorPrediction::error_B, &ErrorPrediction::stddev_B}) {
    EXPECT_LT(largest_step(fine, what), 0.2 * largest_step(coarse, what));
  }
}

TEST_F(Compensated, TheFartherOutTheLessIsClaimed) {
  const auto way = on_the_way_out(model(), 300);
  for (std::size_t k = 60; k < way.size(); ++k) {  // from 16 deg on
    EXPECT_LE(way[k].bias_weight, way[k - 1].bias_weight) << k;
    EXPECT_GE(way[k].stddev_B.norm(), way[k - 1].stddev_B.norm()) << k;
  }
}

TEST_F(Compensated, ACorrectionInTheFadeSettlesAndTellsHowMuchOfTheBiasItTook) {
  JointVector q = inside();
  q(0) = from_deg(19);
  const double weight = model().predict(q, "spindle", "spindle").bias_weight;
  ASSERT_GT(weight, 0.05);
  ASSERT_LT(weight, 0.95);
  const Correction correction = correct(target_at(q));
  EXPECT_EQ(correction.status, CorrectionStatus::kOutOfDomain);
  EXPECT_LT(correction.left, 1e-7);
  EXPECT_NE(correction.message.find(fmt::format("{:.0f} % of the learned bias", 100 * weight)),
            std::string::npos)
      << correction.message;
}

TEST_F(Compensated, AnArmThatStandsAskewInTheTrackersWorldIsPredictedInItsOwnBase) {
  auto cell = std::make_shared<Cell>(*robot_->truth.cell);
  const Matrix3 R_WB = Eigen::AngleAxisd(2.1, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  cell->X_WB = make_pose(R_WB, Vector3(5, -3, 1.2));
  cell->gravity_W = R_WB * cell->gravity_W;
  const VirtualRobot askew = test::chapter_5_robot(cell);
  TrainOptions options;
  options.level = "M2";
  const CompensatedModel model = test::demand(train(cell, test::measured(askew, 200, 31), options));
  const Evaluation evaluation = model.evaluate(test::measured(askew, 300, 32));
  EXPECT_LT(evaluation.compensated.rms, 0.5 * evaluation.calibrated.rms);
  EXPECT_LT(to_mm(evaluation.compensated.rms), 0.1);
  // The motion of the arm in its own base does not depend on where the tracker stands.
  PoseContext context;
  context.q = inside();
  context.tool = context.payload = "spindle";
  const Pose nominal = robot_->truth.nominal_pose_W(context);
  const ErrorPrediction prediction = model.predict(inside(), "spindle", "spindle");
  EXPECT_LT(pose_difference(prediction.X_BT_nominal, nominal).norm(), 1e-9);
  const Vector3 error_B = true_pose_B(inside()).translation() - nominal.translation();
  EXPECT_LT(to_mm((prediction.error_B - error_B).norm()), 0.15);
  EXPECT_GT(to_mm(error_B.norm()), 1);
}

TEST_F(Compensated, WhatWasLearnedWithOneToolIsNotAppliedToAnother) {
  EXPECT_TRUE(model().check_trained_with("spindle", "spindle"));
  const Status other = model().check_trained_with("spindle", "probe");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kRefused);
  EXPECT_EQ(refusal_of(other), Refusal("", {}, "tool_id").text("spindle"));
  CompensatedModel::Parts parts = model().parts();
  parts.trained_with = {{"probe", "spindle"}};
  const CompensatedModel of_another_tool = CompensatedModel::make(std::move(parts)).value();
  const ErrorPrediction prediction = of_another_tool.predict(inside(), "spindle", "spindle");
  EXPECT_FALSE(prediction.in_domain);
  PoseContext context;
  context.q = inside();
  context.tool = context.payload = "spindle";
  EXPECT_LT(
      pose_difference(prediction.X_BT_predicted, model().parts().physics.pose_W(context)).norm(),
      1e-9);
}

TEST_F(Compensated, EveryTargetThatCannotBeCorrectedSaysWhy) {
  Target far = target_at(inside());
  far.X_BT.translation().x() += 3;
  EXPECT_EQ(correct(far).status, CorrectionStatus::kUnreachable);
  EXPECT_TRUE(std::isnan(correct(far).error_before) && std::isnan(correct(far).error_after))
      << "no silent zero";
  JointVector beyond = inside();
  beyond(2) = from_deg(75);  // limit 70
  EXPECT_EQ(correct(target_at(beyond)).status, CorrectionStatus::kJointLimit);
  EXPECT_NE(correct(target_at(beyond)).message.find("joint 3 would be at 75.0 deg, limit 70"),
            std::string::npos)
      << correct(target_at(beyond)).message;
  JointVector stretched = inside();
  stretched(2) = -std::atan2(1.142, 0.2);  // the forearm in line with the upper arm
  EXPECT_EQ(correct(target_at(stretched)).status, CorrectionStatus::kSingular);
  Target nothing = target_at(inside());
  nothing.seed.reset();
  EXPECT_EQ(correct(nothing).status, CorrectionStatus::kRefused);
  EXPECT_FALSE(correct(nothing).message.empty());
}

TEST_F(Compensated, ATargetThatIsLeftAloneIsCommandedAsItWasAndRepeatsItsErrorBefore) {
  JointVector beyond = inside();
  beyond(2) = from_deg(75);  // limit 70
  const Target target = target_at(beyond);
  const Correction correction = correct(target);
  ASSERT_EQ(correction.status, CorrectionStatus::kJointLimit);
  EXPECT_GT(to_mm(correction.error_before), 0.5);
  EXPECT_EQ(correction.error_after, correction.error_before);
  EXPECT_GT(correction.stddev, 0);
  EXPECT_EQ(correction.X_BT_commanded.matrix(), target.X_BT.matrix());
  EXPECT_LT((correction.q - beyond).norm(), 1e-8);
}

TEST_F(Compensated, ATargetThatMeetsALimitOnlyOnceCorrectedSaysByHowMuch) {
  // A joint stands on its limit: half of all corrections push it over.
  int met = 0;
  for (int j = 1; j < 6; ++j) {
    const Joint& joint = model().cell().robot.joint(j);
    for (const double limit : {joint.lower, joint.upper}) {
      JointVector edge = inside();
      edge(j) = limit;
      Target target;
      target.joint_target = true;
      target.seed = edge;
      const Correction correction = correct(target);
      if (correction.status != CorrectionStatus::kJointLimit) continue;
      ++met;
      EXPECT_NE(correction.message.find(fmt::format("joint {} would be at ", j + 1)),
                std::string::npos)
          << correction.message;
      EXPECT_NE(correction.message.find(fmt::format(" deg, limit {:.6g}", to_deg(limit))),
                std::string::npos)
          << correction.message;
      EXPECT_EQ(correction.message.find(fmt::format("at {:.1f} deg", to_deg(limit))),
                std::string::npos)
          << "not told from its limit: " << correction.message;
      EXPECT_EQ(correction.error_after, correction.error_before);
      EXPECT_EQ(correction.q, edge) << "left as it was";
    }
  }
  EXPECT_GT(met, 2);
}

TEST_F(Compensated, WhereAnotherBranchWouldReachItIsSaidAndItDoes) {
  Target target = target_at(inside());
  target.conf = *branch_of(model().cell().robot, inside());
  target.seed.reset();
  int advised = 0;
  for (int conf = 0; conf < 8; ++conf) {
    Target elsewhere = target;
    elsewhere.conf = conf;
    const Correction tried = correct(elsewhere);
    const bool reached =
        tried.status == CorrectionStatus::kOk || tried.status == CorrectionStatus::kOutOfDomain;
    const std::size_t at = tried.message.find("; conf ");
    if (reached) {
      EXPECT_EQ(at, std::string::npos) << tried.message;
      continue;
    }
    ASSERT_NE(at, std::string::npos) << conf << ": " << tried.message;
    const std::string list = tried.message.substr(at);
    for (char digit = '0'; digit <= '7'; ++digit) {
      elsewhere.conf = digit - '0';
      const CorrectionStatus status = correct(elsewhere).status;
      const bool would =
          status == CorrectionStatus::kOk || status == CorrectionStatus::kOutOfDomain;
      EXPECT_EQ(list.find(digit) != std::string::npos, would)
          << "conf " << digit << ": " << tried.message;
    }
    ++advised;
  }
  EXPECT_GT(advised, 2);
}

TEST_F(Compensated, WhatIsExpectedAfterwardsIsTheTrueErrorsStddevWithoutTheInstrumentsNoise) {
  const Correction correction = correct(target_at(inside()));
  ASSERT_EQ(correction.status, CorrectionStatus::kOk) << correction.message;
  const ErrorPrediction there = model().predict(inside(), "spindle", "spindle");
  EXPECT_NEAR(to_mm(correction.error_after), to_mm(there.true_stddev_B.norm()), 1e-6);
  const ErrorPrediction commanded = model().predict(correction.q, "spindle", "spindle");
  EXPECT_NEAR(commanded.true_stddev_B.norm(), there.true_stddev_B.norm(),
              0.02 * there.true_stddev_B.norm());
  EXPECT_NEAR(correction.stddev * std::sqrt(3.0), correction.error_after, 1e-12);
  EXPECT_LT(correction.error_after, there.stddev_B.norm());
  EXPECT_GT(to_mm(correction.error_after), 1e-3)
      << "what the iteration leaves is no error to expect";
}

/// rms of the true errors after correction over rms of those expected.
struct Honesty {
  double true_squared = 0, expected_squared = 0;
  int targets = 0;
  void add(double true_error, double expected) {
    true_squared += true_error * true_error;
    expected_squared += expected * expected;
    ++targets;
  }
  [[nodiscard]] double ratio() const { return std::sqrt(true_squared / expected_squared); }
};

struct InAndOut {
  Honesty in_domain, out_of_domain;
};

/// Corrects the targets that `poses` are the nominal poses of.
void correct_all(const CompensatedModel& model, const VirtualRobot& robot,
                 const MeasurementBatch& poses, InAndOut& honesty) {
  for (const Measurement& m : poses.measurements) {
    PoseContext context = m.context;
    Target target;
    target.X_BT = robot.truth.nominal_pose_W(context);
    target.seed = context.q;
    const Correction correction = model.correct(target, "spindle", "spindle");
    const bool in_domain = correction.status == CorrectionStatus::kOk;
    if (!in_domain && correction.status != CorrectionStatus::kOutOfDomain) continue;
    context.q = correction.q;
    const Vector3 missed = robot.truth.pose_W(context).translation() - target.X_BT.translation();
    (in_domain ? honesty.in_domain : honesty.out_of_domain)
        .add(missed.norm(), correction.error_after);
  }
}

TEST(Corrections, ExpectTheTrueErrorOnAverageOverModels) {
  auto narrow = std::make_shared<Cell>(*test::cell_7());
  narrow->joint_ranges = {{-0.9, 0.9}, {-0.5, 0.5}, {-0.6, 0.5}, {-1, 1}, {0.4, 1.4}, {-1, 1}};
  const VirtualRobot measured_in = test::chapter_5_robot(narrow);
  const VirtualRobot anywhere = test::chapter_5_robot(test::cell_7());
  double in_domain = 0, out_of_domain = 0;
  std::uint64_t seed = 100;
  const std::vector<std::tuple<const char*, const char*, int>> trainings = {
      {"M3", "none", 60},
      {"M3", "se", 100},
      {"M3", "se", 150},
      {"M3", "none", 120},
      {"M2", "se + parameters", 120},
      {"M2", "se", 200}};
  for (const auto& [level, bias, poses] : trainings) {
    TrainOptions options;
    options.level = level;
    options.bias = bias;
    options.seed = ++seed;
    const auto model =
        test::demand(train(narrow, test::measured(measured_in, poses, seed), options));
    InAndOut honesty;
    correct_all(model, measured_in, test::measured(measured_in, 200, 500 + seed), honesty);
    correct_all(model, measured_in, test::measured(anywhere, 200, 600 + seed), honesty);
    in_domain += honesty.in_domain.ratio() / static_cast<double>(trainings.size());
    out_of_domain += honesty.out_of_domain.ratio() / static_cast<double>(trainings.size());
  }
  RecordProperty("in_domain", std::to_string(in_domain));
  RecordProperty("out_of_domain", std::to_string(out_of_domain));
  EXPECT_GT(in_domain, 0.7);
  EXPECT_LT(in_domain, 1.3);
  EXPECT_GT(out_of_domain, 0.4);
  EXPECT_LT(out_of_domain, 1.3);
}

TEST_F(Compensated, AModelIsTheSameAfterItWasStored) {
  const std::string text = serialize(model());
  const Result<CompensatedModel> again = deserialize(text, "memory");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->provenance().hash, model().provenance().hash);
  EXPECT_EQ(serialize(*again), text);
  const ErrorPrediction before = model().predict(inside(), "spindle", "spindle");
  const ErrorPrediction after = again->predict(inside(), "spindle", "spindle");
  EXPECT_EQ(before.error_B, after.error_B);  // bit for bit
  EXPECT_EQ(before.stddev_B, after.stddev_B);
}

TEST_F(Compensated, WhenItWasMeasuredIsKeptAndModelsOfBeforeItWasKeptLoad) {
  CompensatedModel::Parts parts = model().parts();
  parts.provenance.measured_at = 1'600'000'000;
  const CompensatedModel dated = CompensatedModel::make(parts).value();
  EXPECT_EQ(dated.provenance().hash, model().provenance().hash) << "what it is, not of when";
  EXPECT_EQ(deserialize(serialize(dated), "memory")->provenance().measured_at, 1'600'000'000);
  parts.provenance.measured_at.reset();
  const std::string old = serialize(CompensatedModel::make(std::move(parts)).value());
  EXPECT_EQ(old.find("measured_at"), std::string::npos);
  EXPECT_FALSE(test::demand(deserialize(old, "memory")).provenance().measured_at);
}

TEST_F(Compensated, ADamagedModelIsRefused) {
  std::string text = serialize(model());
  const std::size_t place = text.find("\"values\":[") + 12;
  text[place] = text[place] == '1' ? '2' : '1';
  const Result<CompensatedModel> damaged = deserialize(text, "cell.model");
  ASSERT_FALSE(damaged);
  EXPECT_EQ(refusal_of(damaged), Refusal("cell.model", {}, "hash"));
  EXPECT_FALSE(deserialize("{}", "cell.model"));
  EXPECT_FALSE(deserialize("", "cell.model"));
  EXPECT_FALSE(deserialize(serialize(model()).substr(0, 1000), "cell.model"));
}

}  // namespace
}  // namespace trammel
