#include "server/compensate/accuracy.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/measurement/checked_batch.h"
#include "server/tasks/train/train.h"
#include "tests/support/from_rows.h"
#include "tests/support/small_cell.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

/// The radius that holds 95 % of |t| f, with t ~ N(0, I) and ln f ~ N(0, 0.2²): a model's own
/// deviation is doubted as much.
constexpr double kNinetyFive = 3.0539;

constexpr double kScatter = 45e-6;  // m: more than the tracker is said to have

CompensatedModel small_model(double held_out, double noise = kScatter) {
  const auto cell = test::small_cell("cell-3");
  test::SmallBatch shape;
  shape.poses = 400;
  shape.noise = noise;
  const MeasurementBatch batch =
      parse_batch_csv(test::small_batch_csv(*cell, shape), "b.csv").value();
  TrainOptions options;
  options.bias = "none";
  return train(cell, check_against_cell(batch, *cell, drawn(held_out, 1)).value(), options).value();
}

PositionAccuracy accuracy_of(const CompensatedModel& model) {
  return PositionAccuracy::of(model).value();
}

TEST(Accuracy, TakesTheTrackersNoiseOutOfWhatIsLeft) {
  const double tracker = test::small_cell("cell-3")->tracker.sigma;
  const double left = std::sqrt(kScatter * kScatter - tracker * tracker);
  EXPECT_NEAR(accuracy_of(small_model(0)).at(0.95), kNinetyFive * left, 0.03 * kNinetyFive * left);
  EXPECT_LT(accuracy_of(small_model(0, tracker)).at(0.95), 0.5 * kNinetyFive * left);
}

TEST(Accuracy, WhatIsWithinARadiusIsTheShareThatTheRadiusIsOf) {
  const PositionAccuracy accuracy = accuracy_of(small_model(0.3));
  for (const double share : {0.5, 0.9, 0.95, 0.99})
    EXPECT_NEAR(accuracy.within(accuracy.at(share)), share, 1e-3);
  EXPECT_LT(accuracy.least(), accuracy.at(0.95));
  EXPECT_GT(accuracy.most(), accuracy.at(0.95));
}

TEST(Accuracy, PosesHeldOutMoveItAndMakeItSurer) {
  CompensatedModel::Parts parts = small_model(0.3).parts();
  const PositionAccuracy as_is = accuracy_of(CompensatedModel::make(parts).value());
  EXPECT_EQ(as_is.judged_by(), 120);
  parts.validation->compensated.rms *= 1.5;
  const PositionAccuracy worse = accuracy_of(CompensatedModel::make(parts).value());
  EXPECT_GT(worse.at(0.95), 1.2 * as_is.at(0.95));
  parts.validation.reset();
  const PositionAccuracy believed = accuracy_of(CompensatedModel::make(parts).value());
  EXPECT_EQ(believed.judged_by(), 0);
  EXPECT_GT(believed.most() / believed.least(), 1.2 * as_is.most() / as_is.least());
}

TEST(Accuracy, HeldOutPosesOutsideTheDomainDoNotJudgeIt) {
  CompensatedModel::Parts parts = small_model(0.3).parts();
  parts.validation->in_domain = 60;
  EXPECT_EQ(accuracy_of(CompensatedModel::make(parts).value()).judged_by(), 0);
}

TEST(Accuracy, ABatchOfFreshPosesJudgesRowByRow) {
  const CompensatedModel model = small_model(0.3);
  test::SmallBatch shape;
  shape.seed = 2;
  shape.noise = kScatter;
  const MeasurementBatch batch =
      parse_batch_csv(test::small_batch_csv(model.cell(), shape), "f.csv").value();
  MeasurementBatch fresh = check_against_cell(batch, model.cell())->rows();
  const PositionAccuracy accuracy = PositionAccuracy::of(model, fresh).value();
  EXPECT_GT(accuracy.judged_by(), 30);
  for (Measurement& m : fresh.measurements) m.p_W.z() += 150e-6;
  EXPECT_GT(PositionAccuracy::of(model, fresh)->at(0.95), 1.3 * accuracy.at(0.95));
}

TEST(Accuracy, OfAModelWhoseToolIsGoneNothingIsKnown) {
  CompensatedModel::Parts parts = small_model(0).parts();
  parts.trained_with = {{"gone", ""}};
  EXPECT_FALSE(PositionAccuracy::of(CompensatedModel::make(parts).value()));
}

TEST(Accuracy, IsRightAtFreshPosesOfArmsThatItNeverSaw) {
  const auto cell = test::cell_7();
  double right = 0;
  constexpr int kArms = 5;
  for (std::uint64_t arm = 1; arm <= kArms; ++arm) {
    const VirtualRobot robot =
        test::with_zero_off(test::chapter_5_robot(cell), 2, 1e-4 * static_cast<double>(arm));
    TrainOptions options;
    options.bias = "none";
    const CompensatedModel model =
        train(cell,
              check_against_cell(test::measured(robot, 80, arm), *cell, drawn(0.2, arm)).value(),
              options)
            .value();
    VirtualRobot exact = robot;
    exact.sigma = 1e-12;
    const MeasurementBatch truth =
        check_against_cell(test::measured(exact, 300, 50 + arm), *cell)->rows();
    const double radius = accuracy_of(model).at(0.95);
    const CompensatedModel::LevelErrors errors = model.errors_B(truth);
    right += static_cast<double>((errors.compensated.colwise().norm().array() <= radius).count()) /
             300 / kArms;
  }
  EXPECT_GT(right, 0.90);
  EXPECT_LT(right, 0.985);
}

}  // namespace
}  // namespace trammel
