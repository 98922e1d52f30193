#include "server/tasks/train/extend.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/compensate/model_file.h"
#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "server/tasks/train/lasting_sources.h"
#include "tests/support/demand.h"
#include "tests/support/from_rows.h"
#include "tests/support/refusal.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

/// A cell that knows of its base only; the robot's joint 3 oscillates besides.
class Extend : public testing::Test {
 protected:
  Extend() : cell_(test::small_cell("cell-1")) {
    VirtualRobot robot{test::demand(make_physical_model(cell_, {"base", kGear})), 20e-6, 60e-6, {}};
    robot.truth.values(0) = 1e-3;                                // x0
    robot.truth.values.tail<2>() = Eigen::Vector2d(1e-4, 2e-4);  // of the oscillation
    const Eigen::MatrixXd q = test::demand(plan_poses(*cell_, {120, 1}));
    batch_ = test::with_held_out(test::demand(simulate(robot, q, {})), 0.25, 1);
    diagnosis_.sources_before = {"base"};
    diagnosis_.batch.id = "b1";
  }

  CheckedBatch checked(const MeasurementBatch& batch) const {
    return test::demand(check_against_cell(batch, *cell_));
  }

  static constexpr const char* kGear = "gear_transmission:3@2";
  std::shared_ptr<const Cell> cell_;
  MeasurementBatch batch_;
  Diagnosis diagnosis_;
};

TEST_F(Extend, ARefusalSaysHowManyRowsWereSetAside) {
  const Error few = refused("10 poses to diagnose, at least 12").in("batch b1").value();
  EXPECT_EQ(with_rows_set_aside(few, checked(batch_)).message,
            few.message + " (30 of 120 rows are set aside to judge by)");
  for (Measurement& m : batch_.measurements) m.set = MeasurementSet::kTrain;
  EXPECT_EQ(with_rows_set_aside(few, checked(batch_)).message, few.message);
}

TEST_F(Extend, ByTheTrueCauseLowersTheErrorOnPosesHeldOut) {
  diagnosis_.sources_after = {"base", kGear};
  const Extension extension = test::demand(extend(cell_, batch_, diagnosis_, {}));
  EXPECT_TRUE(extension.gain.beyond_chance()) << to_string(extension.gain);
  EXPECT_EQ(extension.gain.poses, 30);
  EXPECT_EQ(extension.after.parts().validation->poses, 30);
  EXPECT_LT(extension.after.parts().validation->compensated.rms, 0.05e-3);
  EXPECT_GT(extension.before.parts().validation->compensated.rms, 0.15e-3);
}

TEST_F(Extend, ByAnotherCauseIsNotCalledBetterThanItIs) {
  diagnosis_.sources_after = {"base", "encoder_eccentricity:6"};
  const Extension extension = test::demand(extend(cell_, batch_, diagnosis_, {}));
  EXPECT_FALSE(extension.gain.beyond_chance()) << to_string(extension.gain);
  EXPECT_GT(extension.after.parts().validation->compensated.rms, 0.15e-3);
}

TEST_F(Extend, LeavesOutWhatThePosesHeldOutDoNotSpeakForHoweverGoodTheRestIs) {
  diagnosis_.sources_after = {"base", "joint_map:5@16", kGear};
  const Extension extension = test::demand(extend(cell_, batch_, diagnosis_, {}));
  EXPECT_EQ(extension.sources, (std::vector<std::string>{"base", kGear}));
  ASSERT_EQ(extension.left_out.size(), 1U);
  EXPECT_EQ(extension.left_out.front().source, "joint_map:5@16");
  EXPECT_LE(extension.left_out.front().z, 0);
  EXPECT_EQ(extension.after.provenance().level, "base,gear_transmission:3@2");
}

TEST_F(Extend, DoesNotAddAnotherFormOfTheComplianceThatTheCellHasAlready) {
  Cell carrying = *cell_;
  carrying.model.error_sources = {"base", "compliance"};
  diagnosis_.sources_before = {"base", "compliance_linear"};
  diagnosis_.sources_after = {"base", "compliance_first_order", kGear};
  EXPECT_EQ(added_sources(carrying.model.error_sources, diagnosis_),
            (std::vector<std::string>{kGear}));
  carrying.model.error_sources = {"base"};
  diagnosis_.sources_before = {"base"};
  EXPECT_EQ(added_sources(carrying.model.error_sources, diagnosis_),
            (std::vector<std::string>{"compliance_first_order", kGear}));
}

TEST_F(Extend, KeepsEveryCauseThatLowersTheErrorByItself) {
  VirtualRobot robot{
      test::demand(make_physical_model(cell_, {"base", kGear, "encoder_eccentricity:2"})),
      20e-6,
      60e-6,
      {}};
  robot.truth.values.tail<4>() = Eigen::Vector4d(1e-4, 2e-4, 2e-4, 1e-4);
  batch_ = test::with_held_out(
      test::demand(simulate(robot, test::demand(plan_poses(*cell_, {120, 1})), {})), 0.25, 1);
  diagnosis_.sources_after = {"base", kGear, "encoder_eccentricity:2"};
  const Extension extension = test::demand(extend(cell_, batch_, diagnosis_, {}));
  EXPECT_EQ(extension.sources, diagnosis_.sources_after);
  EXPECT_TRUE(extension.left_out.empty());
}

/// Row of a pose held out, and the batch with that pose off by `by` (m).
std::pair<int, MeasurementBatch> with_one_off(MeasurementBatch batch, const Vector3& by) {
  for (Measurement& m : batch.measurements) {
    if (m.set != MeasurementSet::kValidation) continue;
    m.p_W += by;
    return {m.row, batch};
  }
  return {-1, batch};
}

TEST_F(Extend, IsNotJudgedByAHeldOutPoseThatFitsNeitherModelAndSaysSo) {
  diagnosis_.sources_after = {"base", kGear};
  const auto [row, batch] = with_one_off(batch_, {0, 0, 0.02});
  const Extension counted = test::demand(extend(cell_, batch, diagnosis_, {}));
  EXPECT_FALSE(counted.gain.beyond_chance())
      << "a pose 20 mm off decides: " << to_string(counted.gain);
  diagnosis_.suspects = {{"bad", row, 0.02, "", true}};
  const Extension extension = test::demand(extend(cell_, batch, diagnosis_, {}));
  EXPECT_TRUE(extension.gain.beyond_chance()) << to_string(extension.gain);
  EXPECT_EQ(extension.gain.poses, 29);
  EXPECT_EQ(extension.gain.left_out.size(), 1U);
  EXPECT_NE(to_string(extension.gain).find("judged without " + extension.gain.left_out.at(0)),
            std::string::npos);
  EXPECT_EQ(extension.after.parts().validation->poses, 30) << "it still counts in the figures";
}

TEST_F(Extend, IsJudgedByAllPosesWhereMoreThanATenthFitNeitherModel) {
  int held_out = 0;
  for (const Measurement& m : batch_.measurements) {
    if (m.set != MeasurementSet::kValidation) continue;
    if (++held_out <= 4) diagnosis_.suspects.push_back({m.pose_id, m.row, 1e-3, "", true});
  }
  MeasurementBatch rows = split_batch(batch_, 0, 1).validation;
  EXPECT_EQ(judges_of(diagnosis_, rows).batch.measurements.size(), 30U);
  diagnosis_.suspects.pop_back();
  EXPECT_EQ(judges_of(diagnosis_, rows).batch.measurements.size(), 27U);
  diagnosis_.suspects[0].held_out = false;
  EXPECT_EQ(judges_of(diagnosis_, rows).left_out.size(), 2U)
      << "one that was learned from is not held out";
}

TEST_F(Extend, IsJudgedAsAServiceJudgesAndNeverByFewerThanThirtyPoses) {
  diagnosis_.sources_after = {"base", kGear};
  int held_out = 0;
  for (Measurement& m : batch_.measurements) {
    if (m.set == MeasurementSet::kValidation && ++held_out > 20) m.set = MeasurementSet::kTrain;
  }
  const Extension extension = test::demand(extend(cell_, batch_, diagnosis_, {}));
  EXPECT_TRUE(extension.gain.beyond_chance()) << to_string(extension.gain);
  EXPECT_NE(extension.why_not().find("20 poses are held out to judge by in the joint ranges of the "
                                     "model without what was found, 30 are needed"),
            std::string::npos)
      << extension.why_not();
}

TEST_F(Extend, FilesHoldOutWhatAServiceDrawsAndWhatTheBatchSays) {
  const CheckedBatch said = test::demand(check_against_cell(batch_, *cell_, held_out_to_extend(1)));
  EXPECT_EQ(said.held_out().measurements.size(), 30U + 18U)
      << "a fifth of those that the batch does not hold out";
  for (Measurement& m : batch_.measurements) m.set = MeasurementSet::kUnassigned;
  const CheckedBatch drawn =
      test::demand(check_against_cell(batch_, *cell_, held_out_to_extend(1)));
  EXPECT_EQ(drawn.held_out().measurements.size(), 34U);
}

TEST_F(Extend, BeginsWithTheNominalModelWhereTheCellListsNoSources) {
  Cell nominal = *cell_;
  nominal.model.error_sources.clear();
  diagnosis_.sources_before = {};
  diagnosis_.sources_after = {"base"};
  const Extension extension =
      test::demand(extend(std::make_shared<const Cell>(nominal), batch_, diagnosis_, {}));
  EXPECT_TRUE(extension.before.parts().physics.sources.empty());
  EXPECT_EQ(extension.after.provenance().level, "base");
}

TEST_F(Extend, SaysWhatATrueCauseIsWorthOnAnotherDayWithAnInterval) {
  diagnosis_.sources_after = {"base", kGear};
  const Extension extension = test::demand(extend(cell_, batch_, diagnosis_, {}));
  ASSERT_TRUE(extension.day);
  EXPECT_EQ(extension.why_not(), "");
  EXPECT_EQ(extension.day->blocks, 5);
  EXPECT_EQ(extension.day->gain.poses, 120);
  const double by_random_rows = 1 - extension.gain.rms_after / extension.gain.rms_before;
  EXPECT_NEAR(extension.day->share, by_random_rows, 0.05);
  EXPECT_LT(extension.day->lower, extension.day->share);
  EXPECT_GT(extension.day->upper, extension.day->share);
  EXPECT_GT(extension.day->lower, 0.5);
}

/// The instrument drifts while it becomes warmer: growth of the arm goes with it in this batch, and
/// on no other day.
MeasurementBatch drifting_as_it_warms(MeasurementBatch batch) {
  const auto rows = static_cast<double>(batch.measurements.size());
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    Measurement& m = batch.measurements[i];
    const double share = static_cast<double>(i) / rows;
    m.context.time = 3600 * share;
    m.context.temperature = 20 + 5 * share;
    m.p_W.z() += 1e-3 * share;
  }
  return batch;
}

TEST_F(Extend, ACauseThatFollowedTheClockOfThisBatchIsNotCarriedToAnotherDay) {
  diagnosis_.sources_after = {"base", kGear, "thermal_growth"};
  const Extension extension =
      test::demand(extend(cell_, drifting_as_it_warms(batch_), diagnosis_, {}));
  EXPECT_EQ(extension.sources, (std::vector<std::string>{"base", kGear}));
  ASSERT_EQ(extension.left_out.size(), 1U);
  EXPECT_EQ(extension.left_out.front().source, "thermal_growth");
  EXPECT_TRUE(extension.left_out.front().another_day) << "rows drawn at random speak for it";
}

TEST_F(Extend, IsNotWorthwhileWhereOnlyThisBatchGains) {
  Cell known = *cell_;
  known.model.error_sources = diagnosis_.sources_before = {"base", kGear};
  diagnosis_.sources_after = {"base", kGear, "thermal_growth"};
  const auto cell = std::make_shared<const Cell>(known);
  Extension extension = test::demand(extend(cell, drifting_as_it_warms(batch_), diagnosis_, {}));
  extension.verdict.put_in_force = true;  // as rows drawn at random may say
  ASSERT_TRUE(extension.day);
  EXPECT_FALSE(extension.day->carries()) << to_string(*extension.day);
  EXPECT_EQ(extension.why_not(), to_string(*extension.day));
}

TEST_F(Extend, WhatTheInstrumentDidIsNoGainOfAnotherDay) {
  VirtualRobot robot{
      test::demand(make_physical_model(cell_, {"base", "tracker_moved@61"})), 20e-6, 60e-6, {}};
  robot.truth.values(robot.truth.values.size() - 6) = 2e-3;
  batch_ = test::with_held_out(
      test::demand(simulate(robot, test::demand(plan_poses(*cell_, {120, 1})), {})), 0.25, 1);
  diagnosis_.sources_after = {"base", "tracker_moved@61"};
  const Extension extension = test::demand(extend(cell_, batch_, diagnosis_, {}));
  EXPECT_LT(extension.gain.rms_after, 0.1 * extension.gain.rms_before)
      << "in this batch it is all of the error";
  ASSERT_TRUE(extension.day);
  EXPECT_NEAR(extension.day->share, 0, 0.05) << to_string(*extension.day);
}

TEST(DayGain, IntervalHoldsTheTrueGainAsOftenAsItSays) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr int kRuns = 400;
  int inside = 0;
  for (int run = 0; run < kRuns; ++run) {
    Eigen::Matrix3Xd before(3, 200), after(3, 200);
    for (Eigen::Index i = 0; i < before.size(); ++i) {
      const double noise = normal(random);
      after.data()[i] = noise;
      before.data()[i] = noise + normal(random);
    }
    const DayGain day = day_gain(before, after);
    const double truth = 1 - std::sqrt(0.5);
    inside += day.lower <= truth && truth <= day.upper ? 1 : 0;
  }
  EXPECT_NEAR(inside / double{kRuns}, 0.94, 0.03);
}

TEST_F(Extend, IsRefusedWhereNothingWasNamed) {
  diagnosis_.verdict = Verdict::kUnknown;
  diagnosis_.sentence = "Something depends on joint 4.";
  diagnosis_.sources_after = diagnosis_.sources_before;
  const auto extension = extend(cell_, batch_, diagnosis_, {});
  ASSERT_FALSE(extension);
  EXPECT_EQ(refusal_of(extension), Refusal("batch " + diagnosis_.batch.id));
}

TEST_F(Extend, IsRefusedWithoutPosesToJudgeItBy) {
  diagnosis_.sources_after = {"base", kGear};
  for (Measurement& m : batch_.measurements) m.set = MeasurementSet::kTrain;
  EXPECT_FALSE(extend(cell_, batch_, diagnosis_, {}));
}

TEST_F(Extend, BeginsWithWhatTheModelInForceWasTrainedWith) {
  TrainOptions options;
  options.level = "base,compliance,gear_transmission:3@2,tracker_moved@12";
  Cell carrying = *cell_;
  carrying.model.error_sources = {"base", "compliance"};
  const CompensatedModel model = test::demand(train(cell_, batch_, options));
  EXPECT_EQ(sources_in_force(model, carrying, checked(batch_)),
            (std::vector<std::string>{"base", "tracker_moved@12", "gear_transmission:3@2",
                                      "compliance"}));
  MeasurementBatch another = batch_;
  another.source_text += "\n";
  EXPECT_EQ(sources_in_force(model, carrying, checked(another)),
            (std::vector<std::string>{"base", "gear_transmission:3@2", "compliance"}));
}

TEST_F(Extend, AMapWhoseSpectrumWasLearnedIsTheOneThatTheCellFileNames) {
  TrainOptions options;
  options.level = "base,compliance,joint_map:2";
  const CompensatedModel model = test::demand(train(cell_, batch_, options));
  const auto& sources = model.parts().physics.sources;
  const auto map = std::find_if(sources.begin(), sources.end(), [](const auto& one) {
    return one->name().starts_with("joint_map:2@");
  });
  ASSERT_NE(map, sources.end());
  EXPECT_NE((*map)->name().find('+'), std::string::npos);
  const CompensatedModel read = test::demand(deserialize(serialize(model), "memory"));
  EXPECT_EQ(read.parts().physics.values, model.parts().physics.values);
  EXPECT_EQ(read.parts().physics.sources[1]->name(), sources[1]->name());
  Cell listing = *cell_;
  for (const char* spelling : {"joint_map:2", "joint_map:*"}) {
    listing.model.error_sources = {"base", spelling, "compliance"};
    EXPECT_EQ(level_with_additions(listing, model, batch_), std::nullopt) << spelling;
    const std::vector<std::string> in_force = sources_in_force(model, listing, checked(batch_));
    EXPECT_EQ(std::count(in_force.begin(), in_force.end(), "joint_map:2"), 1) << spelling;
  }
  listing.model.error_sources = {"base", "compliance"};
  EXPECT_EQ(level_with_additions(listing, model, batch_), "base,compliance," + (*map)->name());
}

TEST(LastingSources, AreThoseThatBelongToTheRobotAndNotToTheBatch) {
  EXPECT_EQ(lasting_sources({"base", "tracker_moved@12", "gear_transmission:3@48.5",
                             "joint_slip:2@40", "tracker_drift"}),
            (std::vector<std::string>{"base", "gear_transmission:3@48.5"}));
}

}  // namespace
}  // namespace trammel
