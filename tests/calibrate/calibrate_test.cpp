#include "server/calibrate/calibrate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/base/units.h"
#include "server/calibrate/refit.h"
#include "server/plan/plan.h"
#include "tests/support/calibrated.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/one_point.h"
#include "tests/support/refusal.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

using test::cell_7;
using test::chapter_5_robot;
using test::demand;
using test::measured;

const std::vector<std::string> kCalibrateM3 = {"base", "geometry", "compliance"};

double validation_rms_mm(const CalibrationResult& result, const MeasurementBatch& batch) {
  double sum = 0;
  for (const Measurement& m : batch.measurements) {
    sum += (m.p_W - result.model.pose_W(m.context).translation()).squaredNorm();
  }
  return to_mm(std::sqrt(sum / static_cast<double>(batch.measurements.size())));
}

TEST(Calibrate, ReachesTheFiguresOfEveryLevelOnPosesItNeverSaw) {
  const auto cell = cell_7();
  const VirtualRobot robot = chapter_5_robot(cell);
  const MeasurementBatch batch = measured(robot, 120, 1);
  const MeasurementBatch fresh = measured(robot, 1000, 2);
  const auto level = [&](const char* name, const std::vector<std::string>& specs) {
    const double rms = validation_rms_mm(*calibrate(cell, specs, batch, {}), fresh);
    test::tell_figure(std::string(name) + ", 120 poses, mm", rms);
    return rms;
  };
  EXPECT_NEAR(level("M0", {}), 9.7, 0.3);
  EXPECT_NEAR(level("M1", {"base"}), 4.2, 0.3);
  EXPECT_NEAR(level("M2", {"base", "geometry"}), 3.9, 0.3);
  EXPECT_LE(level("M3", kCalibrateM3), 0.0245);
}

TEST(Calibrate, ThreePositionsAPoseAreEnough) {
  const auto cell = cell_7();
  const VirtualRobot robot = chapter_5_robot(cell);
  const Result<CalibrationResult> result =
      calibrate(cell, kCalibrateM3, measured(robot, 120, 3, false), {});
  ASSERT_TRUE(result);
  EXPECT_LE(validation_rms_mm(*result, measured(robot, 300, 4)), 0.0265);
}

// The poses are multiplied 64 at a time: a rank update of none of them divided by zero and ended
// the program.
TEST(Calibrate, ManyParametersAndAWholeNumberOfBlocksOfPosesEndNoProgram) {
  const auto cell = cell_7();
  const std::vector<std::string> many = {"base", "geometry", "compliance", "joint_map:1@12"};
  for (const int poses : {64, 128}) {
    const Result<CalibrationResult> result =
        calibrate(cell, many, measured(chapter_5_robot(cell), poses, 3), {});
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_GE(result->parameters.size(), 48U);
  }
}

TEST(Calibrate, FindsAnUnknownBaseAndTool) {
  const auto cell = test::cell_7_unlocated();
  VirtualRobot robot = chapter_5_robot(cell);
  robot.truth.X_WB = make_pose(rotation_exp({0.1, -0.2, 2.2}), {4, -2, 0.3});
  robot.truth.tools["spindle"] = make_pose(rotation_exp({0.5, 0.4, -0.3}), {0.12, -0.05, 0.2});
  std::vector<std::string> specs = kCalibrateM3;
  specs.push_back("tool");
  for (const bool orientation : {true, false}) {
    const Result<CalibrationResult> result =
        calibrate(cell, specs, measured(robot, 200, 5, orientation), {});
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_LE(validation_rms_mm(*result, measured(robot, 300, 6)), 0.026)
        << "orientation " << orientation;
  }
}

TEST(Calibrate, OnePointSeenFromAllSidesTellsTheToolAndSaysThatItHardlyTellsHowTheBaseIsTurned) {
  for (const Vector3& turn :
       {Vector3(0.1, -0.2, 2.8), Vector3(-2.2, 0.4, 0.6), Vector3(0.5, 1.9, -1.2)}) {
    for (const std::vector<std::string>& specs :
         {std::vector<std::string>{}, {"base", "tool", "geometry"}}) {
      const auto cell = test::cell_of_one_point("null", "null", "{error_sources: []}");
      const MeasurementBatch batch = test::one_point(
          *cell, 1e-3 * Vector3(4, -3, 6), make_pose(rotation_exp(turn), {1.2, -0.5, 0.3}), 30, 3);
      const Result<CalibrationResult> result = calibrate(cell, specs, batch, {});
      ASSERT_TRUE(result) << result.error().message;
      EXPECT_LT(to_mm(result->rms), 0.04) << "0.02 mm of noise an axis";
      PoseContext anywhere;
      anywhere.q = JointVector::Zero(6);
      anywhere.tool = "tip";
      const Vector3 p_FT = result->model.state(anywhere).X_FT.translation();
      EXPECT_LT((p_FT - 1e-3 * Vector3(34, -3, 156)).norm(), specs.empty() ? 1e-4 : 2e-3);
      ASSERT_FALSE(result->unidentifiable.empty());
      EXPECT_EQ(result->unidentifiable.front().parameters,
                (std::vector<std::string>{"gamma0", "beta0", "alpha0"}));
    }
  }
}

TEST(Calibrate, OnePointSeenWithAToolThatIsOffTellsHowTheBaseIsTurnedByHowTheToolIsOff) {
  const auto cell = test::cell_of_one_point("null", test::kToolOfOnePoint, "{error_sources: []}");
  for (const Vector3& turn :
       {Vector3(0.1, -0.2, 2.8), Vector3(-2.2, 0.4, 0.6), Vector3(0.5, 1.9, -1.2)}) {
    const Pose X_WB = make_pose(rotation_exp(turn), {1.2, -0.5, 0.3});
    const MeasurementBatch batch = test::one_point(*cell, 1e-3 * Vector3(4, -3, 6), X_WB, 30, 3);
    const Result<CalibrationResult> result = calibrate(cell, {}, batch, {});
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_LT(to_deg(pose_difference(result->model.X_WB, X_WB).tail<3>().norm()), 1);
  }
}

TEST(Calibrate, SaysWhichParametersOnlyTheirSumIsKnownOf) {
  const Result<CalibrationResult> result =
      calibrate(cell_7(), kCalibrateM3, measured(chapter_5_robot(cell_7()), 120, 7), {});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->rank, 33);
  ASSERT_EQ(result->unidentifiable.size(), 3u);
  const auto named = [&](std::vector<std::string> names) {
    std::sort(names.begin(), names.end());
    return std::any_of(result->unidentifiable.begin(), result->unidentifiable.end(),
                       [&](auto combination) {
                         std::sort(combination.parameters.begin(), combination.parameters.end());
                         return combination.parameters == names;
                       });
  };
  EXPECT_TRUE(named({"gamma0", "q1"}));
  EXPECT_TRUE(named({"d1", "z0"}));
  EXPECT_TRUE(named({"C6"}));
  EXPECT_FALSE(test::parameter(*result, "q1").identified);
  EXPECT_FALSE(test::parameter(*result, "C6").identified);
  EXPECT_TRUE(test::parameter(*result, "d4").identified);
}

TEST(Calibrate, StatesUncertaintiesThatFitItsErrors) {
  // d4, a2, alpha3 and C3 have known truths in Table 5.5; over many batches their errors must be as
  // large as stated.
  const auto cell = cell_7();
  const VirtualRobot robot = chapter_5_robot(cell);
  const std::vector<std::pair<std::string, double>> truths = {{"d4", from_mm(-0.3)},
                                                              {"a2", from_mm(-0.3)},
                                                              {"alpha3", -2.6e-4},
                                                              {"C3", from_rad_per_nmm(4e-9)}};
  double sum = 0;
  int count = 0;
  for (std::uint64_t seed = 100; seed < 125; ++seed) {
    const Result<CalibrationResult> result =
        calibrate(cell, {"base", "geometry", "compliance_linear"}, measured(robot, 60, seed), {});
    ASSERT_TRUE(result);
    for (const auto& [name, truth] : truths) {
      const IdentifiedParameter& p = test::parameter(*result, name);
      sum += std::pow((p.value - truth) / p.stddev, 2);
      ++count;
    }
  }
  EXPECT_NEAR(sum / count, 1.0, 0.35);
}

TEST(Calibrate, NeverMakesAComplianceNegative) {
  const auto cell = cell_7();
  for (const std::uint64_t seed : {8, 9, 10}) {
    const Result<CalibrationResult> result =
        calibrate(cell, kCalibrateM3, measured(chapter_5_robot(cell), 60, seed), {});
    ASSERT_TRUE(result);
    for (const IdentifiedParameter& p : result->parameters) {
      if (p.parameter.name.starts_with("C")) {
        EXPECT_GE(p.value, 0) << p.parameter.name;
      }
    }
  }
}

TEST(Calibrate, EstimatesWhatTheModelCannotExplain) {
  // M2 on a robot whose joints give way: the surplus per axis is what it leaves over.
  const auto cell = cell_7();
  const Result<CalibrationResult> result =
      calibrate(cell, {"base", "geometry"}, measured(chapter_5_robot(cell), 200, 11), {});
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->discrepancy, result->rms / std::sqrt(3), 0.1 * result->discrepancy);
  const Result<CalibrationResult> complete =
      calibrate(cell, kCalibrateM3, measured(chapter_5_robot(cell), 200, 11), {});
  EXPECT_LT(complete->discrepancy, 4e-6);
}

TEST(Calibrate, FindsAToolThatNobodyKnowsThoughTheTrackerStandsCentimetresFromWhereTheCellSays) {
  Cell unknown = *cell_7();
  unknown.tools.at("spindle").reset();
  const auto cell = std::make_shared<const Cell>(unknown);
  const VirtualRobot robot = chapter_5_robot(cell_7());
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const auto draw = [&] { return Vector3(normal(random), normal(random), normal(random)); };
    // Its plumb line is right: W is level, and turned.
    const Pose moved =
        make_pose(rotation_exp(0.05 * normal(random) * Vector3::UnitZ()), 0.04 * draw());
    for (const bool oriented : {true, false}) {
      MeasurementBatch batch = measured(robot, 100, seed, oriented);
      for (Measurement& m : batch.measurements) {
        m.p_W = moved * m.p_W;
        if (m.R_WT) m.R_WT = (moved.linear() * *m.R_WT).eval();
      }
      const Result<CalibrationResult> found =
          calibrate(cell, {"base", "geometry", "compliance", "tool"}, batch, {});
      ASSERT_TRUE(found) << "seed " << seed << ": " << sentence(found.error());
      EXPECT_LT(to_mm(found->rms), 0.03) << "seed " << seed;
    }
  }
}

TEST(Calibrate, FewPosesTellHowFarPositionsAreOffThatAreFittedCloserThanOrientations) {
  // The model's own error is in the positions alone, which then decide little and the orientations
  // much; or the other way round. By number, half of the parameters would be fitted to either.
  const auto cell = cell_7();
  double positions = 0, rotations = 0;
  constexpr int kSeeds = 20;
  constexpr double kOff = 1e-4;  // m, rad
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::normal_distribution<double> normal;
    const MeasurementBatch batch =
        measured(chapter_5_robot(cell), 20, static_cast<std::uint64_t>(seed));
    MeasurementBatch shifted = batch, turned = batch;
    for (Measurement& m : shifted.measurements)
      m.p_W += kOff * Vector3(normal(random), normal(random), normal(random));
    for (Measurement& m : turned.measurements)
      m.R_WT =
          (rotation_exp(kOff * Vector3(normal(random), normal(random), normal(random))) * *m.R_WT)
              .eval();
    positions += demand(calibrate(cell, kCalibrateM3, shifted, {})).discrepancy / kOff / kSeeds;
    rotations +=
        demand(calibrate(cell, kCalibrateM3, turned, {})).discrepancy_rotation / kOff / kSeeds;
  }
  EXPECT_NEAR(positions, 1, 0.06);
  EXPECT_NEAR(rotations, 1, 0.06);
}

TEST(Calibrate, WeighsAPointByItsOwnSigma) {
  const auto cell = cell_7();
  const VirtualRobot robot = chapter_5_robot(cell);
  MeasurementBatch batch = measured(robot, 120, 12);
  for (std::size_t i = 0; i < batch.measurements.size(); i += 4) {  // a quarter is bad, and says so
    Measurement& m = batch.measurements[i];
    m.sigma = 1e-3;
    m.p_W +=
        1e-3 * Vector3(std::sin(double(i)), std::cos(2.0 * double(i)), std::sin(3.0 * double(i)));
  }
  EXPECT_LE(validation_rms_mm(*calibrate(cell, kCalibrateM3, batch, {}), measured(robot, 300, 13)),
            0.0255);
}

TEST(Calibrate, ListsABadPoseAndIsNotPulledByIt) {
  const auto cell = cell_7();
  const VirtualRobot robot = chapter_5_robot(cell);
  MeasurementBatch batch = measured(robot, 120, 15);
  batch.measurements[40].p_W += Vector3(0, 0.4e-3, 0);
  const Result<CalibrationResult> result = calibrate(cell, kCalibrateM3, batch, {});
  ASSERT_TRUE(result);
  ASSERT_EQ(result->suspects.size(), 1u);
  EXPECT_EQ(result->suspects[0].pose_id, batch.measurements[40].pose_id);
  EXPECT_NEAR(to_mm(result->suspects[0].distance), 0.4, 0.06);
  EXPECT_LE(validation_rms_mm(*result, measured(robot, 300, 16)), 0.0245);
  EXPECT_TRUE(calibrate(cell, kCalibrateM3, measured(robot, 120, 15), {})->suspects.empty());
}

TEST(Calibrate, FindsTheOrdersOfGearsItWasNotTold) {
  const auto cell = cell_7();
  VirtualRobot robot = chapter_5_robot(cell);
  PhysicalModel geared =
      *make_physical_model(cell, {"base", "geometry", "compliance_linear",
                                  "gear_transmission:1@63.4", "gear_transmission:4@28.7"});
  geared.values.head(36 - 6) = robot.truth.values.head(36 - 6);
  geared.values.tail(6) = robot.truth.values.tail(6);
  geared.values.segment(30, 6) << 63.4, 3e-5, -2e-5, 28.7, 4e-5, 5e-5;
  robot.truth = geared;
  const Result<CalibrationResult> result = calibrate(
      cell, {"base", "geometry", "compliance_linear", "gear_transmission:1", "gear_transmission:4"},
      measured(robot, 200, 17), {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NEAR(test::parameter(*result, "order1").value, 63.4, 0.1);
  EXPECT_NEAR(test::parameter(*result, "order4").value, 28.7, 0.1);
  EXPECT_NEAR(test::parameter(*result, "gear_sin1").value, 3e-5, 4e-6);
  EXPECT_LE(validation_rms_mm(*result, measured(robot, 300, 18)), 0.0255);
}

TEST(Calibrate, TellsTwoToolsAndTwoPayloadsApartInOneBatch) {
  auto cell = std::make_shared<Cell>(*cell_7());
  cell->tools["probe"] = make_pose(rotation_exp({0.2, -0.4, 0.1}), {-0.05, 0.12, 0.22});
  cell->payloads["light"] = Payload{30, {0, 0.02, 0.05}};
  VirtualRobot robot = chapter_5_robot(cell);
  robot.truth.tools["probe"].translation() +=
      Vector3(0.8e-3, -0.5e-3, 0.3e-3);  // the probe was bent
  MeasurementBatch batch;
  batch.id = "two";
  const Eigen::MatrixXd q = latin_hypercube(*planning_ranges(*cell), 240, 19);
  std::vector<PoseContext> poses(240);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].q = q.row(static_cast<Eigen::Index>(i)).transpose();
    poses[i].tool = i % 2 == 0 ? "spindle" : "probe";
    poses[i].payload = i % 3 == 0 ? "spindle" : "light";
  }
  batch = *simulate(robot, poses, {});
  batch.id = "two";
  const Result<CalibrationResult> result =
      calibrate(cell, {"base", "geometry", "compliance_linear", "tool", "payload"}, batch, {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_LE(to_mm(result->rms), 0.0235);
  // The part that two tools share is the last link's; their difference is known.
  EXPECT_NEAR(
      test::parameter(*result, "tx[probe]").value - test::parameter(*result, "tx[spindle]").value,
      0.8e-3, 2e-5);
  EXPECT_NEAR(
      test::parameter(*result, "ty[probe]").value - test::parameter(*result, "ty[spindle]").value,
      -0.5e-3, 2e-5);
  // One mass scales the compliances; two masses leave their ratio known: neither may be off alone.
  EXPECT_NEAR(test::parameter(*result, "mass[light]").value / 30,
              test::parameter(*result, "mass[spindle]").value / 100, 0.01);
}

TEST(Calibrate, RefitsTheToolAndLeavesTheRobotAlone) {
  const auto cell = cell_7();
  VirtualRobot robot = chapter_5_robot(cell);
  const CalibrationResult first = *calibrate(
      cell, {"base", "geometry", "compliance_linear", "tool"}, measured(robot, 200, 20), {});
  robot.truth.tools["spindle"].translation() +=
      Vector3(1e-3, -2e-3, 0.5e-3);  // another tool of the same kind
  const Result<CalibrationResult> second =
      refit(first, cell, measured(robot, 15, 21), {"tool"}).map([](const Refit& refit) {
        return refit.result;
      });
  ASSERT_TRUE(second) << second.error().message;
  EXPECT_LE(validation_rms_mm(*second, measured(robot, 300, 22)), 0.030);
  for (const IdentifiedParameter& p : second->parameters) {
    if (p.parameter.name.starts_with("t")) continue;
    EXPECT_EQ(p.value, test::parameter(first, p.parameter.name).value) << p.parameter.name;
    EXPECT_EQ(p.stddev, test::parameter(first, p.parameter.name).stddev) << p.parameter.name;
  }
  EXPECT_FALSE(refit(first, cell, measured(robot, 15, 21), {"gremlins"}));
}

TEST(Calibrate, RefitsACauseThatTheModelDidNotHaveAndTheFormThatItHas) {
  const auto cell = cell_7();
  VirtualRobot robot = chapter_5_robot(cell);
  const CalibrationResult plain =
      *calibrate(cell, {"base", "geometry", "compliance_linear"}, measured(robot, 200, 24), {});
  robot.truth.tools["spindle"].translation() += Vector3(-1e-3, 1e-3, 1e-3);
  const Result<CalibrationResult> added =
      refit(plain, cell, measured(robot, 40, 25), {"tool", "compliance"})
          .map([](const Refit& refit) { return refit.result; });
  ASSERT_TRUE(added) << added.error().message;
  EXPECT_LE(validation_rms_mm(*added, measured(robot, 300, 26)), 0.030);
  EXPECT_NEAR(test::parameter(*added, "tx").value, -1e-3, 5e-5);
  // A parameter that is held is known or was not known before: nothing new is said of it.
  for (const UnidentifiableCombination& combination : added->unidentifiable) {
    const bool before =
        std::any_of(plain.unidentifiable.begin(), plain.unidentifiable.end(),
                    [&](const auto& known) { return known.sentence == combination.sentence; });
    EXPECT_TRUE(before || combination.parameters.front()[0] == 't' ||
                combination.parameters.front()[0] == 'C')
        << combination.sentence;
  }
}

/// With maps of all joints, which are known to be nothing.
CalibrationResult with_idle_maps(CalibrationResult known, int harmonics) {
  const auto own = static_cast<Eigen::Index>(known.parameters.size());
  for (int joint = 1; joint <= 6; ++joint) {
    const std::string spec = fmt::format("joint_map:{}@{}", joint, harmonics);
    add_source(known.model, test::demand(make_error_source(spec, *known.model.cell)));
  }
  const std::vector<Parameter> parameters = known.model.parameters();
  const auto all = static_cast<Eigen::Index>(parameters.size());
  std::vector<Eigen::Index> places;
  std::vector<IdentifiedParameter> identified;
  for (Eigen::Index k = 0; k < all; ++k) {
    const auto& p = parameters[static_cast<std::size_t>(k)];
    const bool map = p.name.starts_with("map");
    identified.push_back(map ? IdentifiedParameter{p, 0, 0, true}
                             : known.parameters[places.size()]);
    if (!map) places.push_back(k);
  }
  EXPECT_EQ(static_cast<Eigen::Index>(places.size()), own);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(all, all);
  covariance(places, places) = known.covariance;
  known.parameters = std::move(identified);
  known.covariance = std::move(covariance);
  return known;
}

TEST(Calibrate, WhatIsKeptHasNoPartInARefitHoweverMuchItIs) {
  const auto cell = cell_7();
  VirtualRobot robot = chapter_5_robot(cell);
  const CalibrationResult few = *calibrate(cell, {"base", "geometry", "compliance_linear", "tool"},
                                           measured(robot, 200, 20), {});
  const CalibrationResult many = with_idle_maps(few, 80);
  EXPECT_EQ(many.parameters.size(), few.parameters.size() + 960);
  robot.truth.tools["spindle"].translation() += Vector3(1e-3, -2e-3, 0.5e-3);
  const MeasurementBatch batch = measured(robot, 60, 21);
  const Refit one = test::demand(refit(few, cell, batch, {"base", "tool"}));
  const Refit other = test::demand(refit(many, cell, batch, {"base", "tool"}));
  for (const Eigen::Index k : one.anew) {
    const IdentifiedParameter& p = one.result.parameters[static_cast<std::size_t>(k)];
    EXPECT_NEAR(test::parameter(other.result, p.parameter.name).value, p.value, 1e-9)
        << p.parameter.name;
    EXPECT_NEAR(test::parameter(other.result, p.parameter.name).stddev, p.stddev, 1e-3 * p.stddev)
        << p.parameter.name;
  }
  EXPECT_EQ(other.result.rank, one.result.rank + 960);
}

TEST(Calibrate, RefusesACauseWhoseContextWasNotRecorded) {
  const auto cell = cell_7();
  const MeasurementBatch batch = measured(chapter_5_robot(cell), 30, 23);
  const std::pair<const char*, const char*> lacking[] = {{"thermal_growth", "temperature_c"},
                                                         {"tracker_drift", "time_s"},
                                                         {"backlash:2", "dir2"},
                                                         {"time_lag", "time_s"}};
  for (const auto& [spec, column] : lacking) {
    const Result<CalibrationResult> result = calibrate(cell, {"base", spec}, batch, {});
    EXPECT_EQ(refusal_of(result), Refusal("batch virtual", {}, column).text(spec)) << spec;
  }
}

TEST(Calibrate, RefusesJointsThatDoNotLeadToThePositionsBesideThem) {
  const auto cell = cell_7();
  const MeasurementBatch batch = measured(chapter_5_robot(cell), 60, 12);
  MeasurementBatch swapped = batch;
  for (Measurement& m : swapped.measurements) std::swap(m.context.q(1), m.context.q(2));
  MeasurementBatch moved = batch;
  for (std::size_t i = 0; i < moved.measurements.size(); ++i)
    moved.measurements[i].context.q =
        batch.measurements[(i + 1) % batch.measurements.size()].context.q;
  for (const MeasurementBatch& wrong : {swapped, moved}) {
    const auto result = calibrate(cell, {"base", "geometry"}, wrong, {});
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::kRefused);
    EXPECT_EQ(result.error().file, "batch virtual");
    EXPECT_EQ(result.error().field, "x_mm");
    EXPECT_GT(result.error().value, result.error().limit);
    EXPECT_FALSE(result.error().next.empty());
  }
  EXPECT_TRUE(calibrate(cell, {"base", "geometry"}, batch, {}));
}

TEST(Calibrate, RefusesWhatCannotBeFound) {
  const auto cell = test::cell_7_unlocated();
  MeasurementBatch few = measured(chapter_5_robot(cell), 120, 14, false);
  few.measurements.resize(4);
  const Result<CalibrationResult> result = calibrate(cell, {"base"}, few, {});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kRefused);
  EXPECT_EQ(refusal_of(result), Refusal("batch virtual").beyond(4, 6));
  few.measurements.clear();
  EXPECT_FALSE(calibrate(cell, {"base"}, few, {}));
}

}  // namespace
}  // namespace trammel
