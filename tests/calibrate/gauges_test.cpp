#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/calibrate/identify/weighted_pose.h"
#include "server/error_sources/anchors.h"
#include "server/robot/cell.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/gauged_arm.h"
#include "tests/support/one_point.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::gauge_batch;
using test::gauged_arm;
using test::GaugedArm;
using test::GaugeRow;
using test::three_corners;
using test::unknown_places;
using test::wire_rows;

const std::vector<std::string> kGaugesM3 = {"base", "geometry", "compliance"};
constexpr double kSigma = 0.05;  // mm, of a good draw wire

const IdentifiedParameter* parameter(const CalibrationResult& result, const std::string& name) {
  const auto found =
      std::find_if(result.parameters.begin(), result.parameters.end(),
                   [&](const IdentifiedParameter& p) { return p.parameter.name == name; });
  return found == result.parameters.end() ? nullptr : &*found;
}

std::string sentences(const CalibrationResult& result) {
  std::string text;
  for (const UnidentifiableCombination& one : result.unidentifiable) text += one.sentence + "\n";
  return text;
}

bool has_source(const CalibrationResult& result, std::string_view name) {
  return std::any_of(result.model.sources.begin(), result.model.sources.end(),
                     [&](const ErrorSourcePtr& source) { return source->name() == name; });
}

TEST(Gauges, DrawWiresToKnownAnchorsTellTheArmAsWellAsTheyCan) {
  double missed = 0, least = 0, by_positions = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const GaugedArm arm = gauged_arm(seed, three_corners());
    const std::vector<GaugeRow> rows = wire_rows(arm, 200, seed);
    ASSERT_EQ(rows.size(), 200U);
    const Result<CalibrationResult> found =
        calibrate(arm.cell, kGaugesM3, gauge_batch(arm, rows, kSigma, seed), {});
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_TRUE(found->converged);
    EXPECT_FALSE(has_source(*found, kInstrumentZero)) << "nothing asks for a zero";
    missed += std::pow(test::volumetric_mm(arm, *found, false, 1000 + seed), 2);
    least += std::pow(test::least_volumetric_mm(arm, rows, kSigma, true, false, 1000 + seed), 2);
    const auto positions = gauge_batch(arm, test::position_rows(arm, 200, seed), kSigma, seed);
    by_positions +=
        std::pow(test::volumetric_mm(arm, *calibrate(arm.cell, kGaugesM3, positions, {}), false,
                                     1000 + seed),
                 2);
  }
  test::tell_figure("200 distances over the bound", std::sqrt(missed / least));
  test::tell_figure("200 distances over 200 positions", std::sqrt(missed / by_positions));
  EXPECT_LE(std::sqrt(missed / least), 1.2);  // of 3 seeds; 1.1 of many is a benchmark's
  EXPECT_LE(std::sqrt(missed / by_positions), 2.5);
}

TEST(Gauges, DrawWiresToAnchorsThatNobodyMeasuredTellTheArmButNotWhereItStands) {
  double missed = 0, least = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const GaugedArm arm = gauged_arm(seed, three_corners(), unknown_places(three_corners()));
    const std::vector<GaugeRow> rows = wire_rows(arm, 200, seed);
    const Result<CalibrationResult> found =
        calibrate(arm.cell, kGaugesM3, gauge_batch(arm, rows, kSigma, seed), {});
    ASSERT_TRUE(found) << found.error().message;
    missed += std::pow(test::volumetric_mm(arm, *found, true, 1000 + seed), 2);
    least += std::pow(test::least_volumetric_mm(arm, rows, kSigma, false, true, 1000 + seed), 2);
    EXPECT_NE(sentences(*found).find("do not tell where the base stands"), std::string::npos)
        << sentences(*found);
    // Told in the base's frame, the anchors are where they are; in the world as uncertain as the
    // base is.
    ASSERT_NE(parameter(*found, "ax[a1]"), nullptr);
    EXPECT_GT(parameter(*found, "ax[a1]")->stddev, from_mm(0.5));
  }
  test::tell_figure("200 distances to unknown anchors over the bound", std::sqrt(missed / least));
  EXPECT_LE(std::sqrt(missed / least), 1.2);
}

TEST(Gauges, OneKnownAnchorLeavesTheTurnsAboutItAndTwoThatAboutTheirLine) {
  const std::string one =
      "{a1: {xyz_mm: [2300, -1500, 100]}, a2: {xyz_mm: null}, a3: {xyz_mm: null}}";
  const std::string two =
      "{a1: {xyz_mm: [2300, -1500, 100]}, a2: {xyz_mm: [1900, 1700, 400]}, a3: {xyz_mm: null}}";
  for (const auto& [yaml, said] :
       {std::pair(one, "how the base is turned about it"), std::pair(two, "about the line")}) {
    const GaugedArm arm = gauged_arm(4, three_corners(), yaml);
    const auto found =
        calibrate(arm.cell, kGaugesM3, gauge_batch(arm, wire_rows(arm, 150, 4), kSigma, 4), {});
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_NE(sentences(*found).find(said), std::string::npos) << sentences(*found);
  }
}

TEST(Gauges, TheZeroOfAnInstrumentIsFoundWhereTheDistancesAskForIt) {
  for (const double zero : {0.7, 80.0}) {
    const GaugedArm arm = gauged_arm(5, three_corners());
    const auto found = calibrate(arm.cell, kGaugesM3,
                                 gauge_batch(arm, wire_rows(arm, 200, 5, zero), kSigma, 5), {});
    ASSERT_TRUE(found) << found.error().message;
    ASSERT_TRUE(has_source(*found, kInstrumentZero)) << zero;
    for (const char* name : {"zero[a1]", "zero[a2]", "zero[a3]"}) {
      const IdentifiedParameter* told = parameter(*found, name);
      ASSERT_NE(told, nullptr);
      EXPECT_NEAR(to_mm(told->value), zero, 4 * to_mm(told->stddev)) << name;
      EXPECT_LT(to_mm(told->stddev), 0.2) << name;
    }
  }
}

TEST(Gauges, AZeroThatTheCellFileTellsIsTakenOff) {
  const std::string yaml =
      "{a1: {xyz_mm: [2300, -1500, 100], zero_mm: 0.7}, a2: {xyz_mm: [1900, 1700, 400], zero_mm: "
      "0.7}, a3: {xyz_mm: [2600, 200, 2600], zero_mm: 0.7}}";
  const GaugedArm arm = gauged_arm(5, three_corners(), yaml);
  const auto found =
      calibrate(arm.cell, kGaugesM3, gauge_batch(arm, wire_rows(arm, 200, 5, 0.7), kSigma, 5), {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_FALSE(has_source(*found, kInstrumentZero));
  EXPECT_LT(to_mm(found->rms), 1.1 * kSigma);
}

/// Rows of every kind about one pose each.
std::vector<GaugeRow> every_kind(const GaugedArm& arm, int each, std::uint64_t seed) {
  std::vector<GaugeRow> rows;
  const auto point = [&](std::size_t k) { return rows[k].p_mm; };
  for (GaugeRow row : test::position_rows(arm, 6 * each, seed)) {
    const std::size_t k = rows.size();
    rows.push_back(row);
    const Eigen::Vector3d& a1 = arm.anchors_mm.at("a1");
    if (k % 6 == 1) {
      rows[k].anchor = "a1", rows[k].column = "distance_mm",
      rows[k].value_mm = (point(k) - a1).norm();
    } else if (k % 6 == 2) {
      rows[k].anchor = "ball", rows[k].column = "touch_mm";
      rows[k].value_mm = (point(k) - arm.anchors_mm.at("ball")).norm() - 12.7;
    } else if (k % 6 == 3) {
      rows[k].anchor = "table", rows[k].column = "touch_mm";
      rows[k].value_mm = (point(k) - arm.anchors_mm.at("table")).dot(Eigen::Vector3d(0, 0.6, 0.8));
    } else if (k % 6 == 4) {
      const Eigen::Vector3d d = point(k) - arm.anchors_mm.at("bore");
      rows[k].anchor = "bore", rows[k].column = "touch_mm",
      rows[k].value_mm = std::hypot(d.x(), d.z()) - 25;
    } else if (k % 6 == 5) {
      rows[k].anchor = "a1", rows[k].column = "distance_mm",
      rows[k].minus_pose = fmt::format("p{}", k);
      rows[k].value_mm = (point(k) - a1).norm() - (point(k - 1) - a1).norm();
    }
  }
  return rows;
}

GaugedArm arm_with_every_kind(std::uint64_t seed) {
  return gauged_arm(
      seed,
      {{"a1", {2300, -1500, 100}},
       {"ball", {1500, 600, 500}},
       {"table", {1500, 0, 200}},
       {"bore", {1400, -500, 900}}},
      "{a1: {xyz_mm: null, zero_mm: null}, ball: {xyz_mm: null, sphere_radius_mm: 12.7, zero_mm: "
      "0}, table: {xyz_mm: [1500, 0, 200], plane_normal: [0, 0.6, 0.8], zero_mm: 0}, bore: "
      "{xyz_mm: [1400, -500, 900], ring_axis: [0, 1, 0], ring_radius_mm: 25, zero_mm: 0}}");
}

TEST(Gauges, DerivativesAreExactForEveryKind) {
  const GaugedArm arm = arm_with_every_kind(6);
  const MeasurementBatch batch = gauge_batch(arm, every_kind(arm, 4, 6), kSigma, 6);
  PhysicalModel model = test::demand(make_physical_model(
      arm.cell, {"base", "geometry", "compliance", "anchors", "instrument_zero"}));
  for (const auto& [id, p] : arm.anchors_mm) {
    const Eigen::Index place = placed_anchor(model, id).place;
    if (place >= 0) model.values.segment<3>(place) = from_mm(1) * p;
  }
  const ScaledParameters s = scaled_parameters(model, {});
  Eigen::VectorXd x = s.prior;
  for (Eigen::Index k = 0; k < x.size(); ++k) x(k) += 1e-4 * std::sin(1.0 + static_cast<double>(k));
  int gauges = 0;
  for (const Measurement& m : batch.measurements) {
    if (!m.gauge) continue;
    ++gauges;
    const WeightedPose pose(model, s, m, {});
    ASSERT_EQ(pose.size(), 1);
    Eigen::RowVectorXd J(x.size());
    double at = 0;
    ASSERT_TRUE(pose.evaluate(x.data(), &at, J.data()));
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      constexpr double kStep = 1e-5;
      Eigen::VectorXd up = x, down = x;
      up(k) += kStep, down(k) -= kStep;
      double above = 0, below = 0;
      ASSERT_TRUE(pose.evaluate(up.data(), &above, nullptr) &&
                  pose.evaluate(down.data(), &below, nullptr));
      const double numeric = (above - below) / (2 * kStep);
      EXPECT_NEAR(J(k), numeric, 1e-4 * std::max(1.0, std::abs(numeric))) << m.pose_id << " " << k;
    }
  }
  EXPECT_EQ(gauges, 20);
}

TEST(Gauges, PositionsDistancesTouchesAndDifferencesAreOneBatch) {
  for (std::uint64_t seed = 7; seed <= 8; ++seed) {
    const GaugedArm arm = arm_with_every_kind(seed);
    const std::vector<GaugeRow> rows = every_kind(arm, 40, seed);
    const MeasurementBatch batch = gauge_batch(arm, rows, kSigma, seed);
    ASSERT_EQ(batch.measurements.size(), rows.size());
    const Result<CalibrationResult> found = calibrate(arm.cell, kGaugesM3, batch, {});
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_LT(to_mm(found->discrepancy), 0.02) << "every kind fits with its own sigma";
    const double together = test::volumetric_mm(arm, *found, false, 50);
    MeasurementBatch positions = batch;
    std::erase_if(positions.measurements, [](const Measurement& m) { return m.gauge.has_value(); });
    const auto alone = calibrate(arm.cell, kGaugesM3, positions, {});
    ASSERT_TRUE(alone) << alone.error().message;
    EXPECT_LT(together, 0.8 * test::volumetric_mm(arm, *alone, false, 50));
    for (const char* axis : {"ax", "ay", "az"}) {
      const Eigen::Vector3d& truth = arm.anchors_mm.at("ball");
      const IdentifiedParameter* told = parameter(*found, fmt::format("{}[ball]", axis));
      ASSERT_NE(told, nullptr);
      EXPECT_NEAR(to_mm(told->value), truth(axis[1] - 'x'), 4.5 * to_mm(told->stddev)) << axis;
      EXPECT_TRUE(told->identified);
    }
  }
}

TEST(Gauges, AWrongDistanceIsASuspectAndDoesNoHarm) {
  const GaugedArm arm = gauged_arm(9, three_corners());
  std::vector<GaugeRow> rows = wire_rows(arm, 200, 9);
  rows[20].value_mm += 5;
  const auto found = calibrate(arm.cell, kGaugesM3, gauge_batch(arm, rows, kSigma, 9), {});
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_FALSE(found->suspects.empty());
  EXPECT_EQ(found->suspects.front().pose_id, "p21");
  EXPECT_NEAR(to_mm(found->suspects.front().distance), 5, 1);
  EXPECT_LT(test::volumetric_mm(arm, *found, false, 60),
            2 * test::least_volumetric_mm(arm, rows, kSigma, true, false, 60));
}

/// Poses of the second simulation whose tool is within the stroke of a ballbar about `centre`: the
/// first three joints bring it there, the wrist is as drawn.
std::vector<GaugeRow> ballbar_rows(const GaugedArm& arm, double length_mm, double stroke_mm,
                                   int count) {
  const Eigen::Vector3d centre = arm.anchors_mm.at("c");
  hidden::Random random(17);
  std::vector<GaugeRow> rows;
  const auto at = [&](const hidden::MeasuringPose& pose) {
    hidden::Arm one = arm.world.arm;
    one.tool = arm.world.tools.front();
    one.load = arm.world.loads.front();
    return Eigen::Vector3d(hidden::tool_frame(one, pose.q).block<3, 1>(0, 3));
  };
  while (static_cast<int>(rows.size()) < count) {
    hidden::MeasuringPose pose;
    const Eigen::Vector3d towards = Eigen::Vector3d(hidden::normal(random), hidden::normal(random),
                                                    std::abs(hidden::normal(random)))
                                        .normalized();
    const Eigen::Vector3d wanted =
        centre + (length_mm + hidden::uniform(random, -stroke_mm, stroke_mm)) * towards;
    pose.q << 0.1, 0.2, 0.1, hidden::uniform(random, -1.5, 1.5), hidden::uniform(random, -1.0, 1.0),
        hidden::uniform(random, -2, 2);
    for (int k = 0; k < 30; ++k) {
      const Eigen::Vector3d missing = wanted - at(pose);
      Eigen::Matrix3d J;
      for (int j = 0; j < 3; ++j) {
        hidden::MeasuringPose moved = pose;
        moved.q(j) += 1e-5;
        J.col(j) = (at(moved) - at(pose)) / 1e-5;
      }
      const Eigen::Vector3d step = J.colPivHouseholderQr().solve(missing);
      pose.q.head<3>() += step * std::min(1.0, 0.3 / std::max(1e-9, step.norm()));
    }
    const double distance = (at(pose) - centre).norm();
    const auto ranges = hidden::joint_ranges("calibration");
    bool reachable = std::abs(distance - length_mm) <= stroke_mm;
    for (std::size_t j = 0; j < 3; ++j)
      reachable = reachable && pose.q(static_cast<Eigen::Index>(j)) > ranges[j].first &&
                  pose.q(static_cast<Eigen::Index>(j)) < ranges[j].second;
    if (reachable) rows.push_back({pose, "c", "distance_mm", distance, "", {0, 0, 0}});
  }
  return rows;
}

TEST(Gauges, ATelescopingBallbarSaysWhatItsStrokeCannotKnow) {
  const std::map<std::string, Eigen::Vector3d> centre = {{"c", {1500, 200, 700}}};
  const GaugedArm exact = gauged_arm(11, centre, "{c: {xyz_mm: null}}");
  const std::vector<GaugeRow> rows = ballbar_rows(exact, 300, 1.2, 100);
  const auto found = calibrate(exact.cell, kGaugesM3, gauge_batch(exact, rows, 0.001, 11), {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_FALSE(has_source(*found, kInstrumentZero)) << "no stroke of a ballbar asks for its zero";
  EXPECT_NE(sentences(*found).find("do not tell where the base stands"), std::string::npos);
  EXPECT_NE(sentences(*found).find("all 100 distances are between 29"), std::string::npos)
      << sentences(*found);
  EXPECT_NE(sentences(*found).find("taken as exact"), std::string::npos) << sentences(*found);

  const GaugedArm open = gauged_arm(11, centre, "{c: {xyz_mm: null, zero_mm: null}}");
  const auto unsure = calibrate(open.cell, kGaugesM3, gauge_batch(open, rows, 0.001, 11), {});
  ASSERT_TRUE(unsure) << unsure.error().message;
  EXPECT_NE(sentences(*unsure).find(
                "zero and the robot's size (all lengths alike) change the distances nearly alike"),
            std::string::npos)
      << sentences(*unsure);
  const IdentifiedParameter* zero = parameter(*unsure, "zero[c]");
  ASSERT_NE(zero, nullptr);
  EXPECT_LE(std::abs(zero->value), 3 * zero->stddev);
}

TEST(Gauges, WhatDistancesDoNotTellIsRefusedWithWhatToDo) {
  const GaugedArm arm = gauged_arm(12, three_corners(), unknown_places(three_corners()));
  const auto refusal = [&](const GaugedArm& of, const std::vector<GaugeRow>& rows) {
    const auto found = calibrate(of.cell, kGaugesM3, gauge_batch(of, rows, kSigma, 12), {});
    return found ? std::string("learned") : found.error().message;
  };
  EXPECT_NE(refusal(arm, wire_rows(arm, 9, 12)).find("at least 4 are needed"), std::string::npos);

  auto nowhere = std::make_shared<Cell>(*arm.cell);
  nowhere->X_WB.reset();
  GaugedArm based = arm;
  based.cell = nowhere;
  EXPECT_NE(
      refusal(based, wire_rows(arm, 60, 12)).find("distances alone do not tell where the base is"),
      std::string::npos);

  std::vector<GaugeRow> wrong = wire_rows(arm, 60, 12);
  for (std::size_t i = 0; i + 1 < wrong.size(); ++i) std::swap(wrong[i].pose, wrong[i + 1].pose);
  EXPECT_NE(refusal(gauged_arm(12, three_corners()), wrong).find("do not lead to these distances"),
            std::string::npos);

  MeasurementBatch two = gauge_batch(arm, wire_rows(arm, 60, 12), kSigma, 12);
  two.sessions = {"monday", "tuesday"};
  for (std::size_t i = 30; i < 60; ++i) two.measurements[i].session = 1;
  const auto found = calibrate(arm.cell, kGaugesM3, two, {});
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("set-ups of the instrument"), std::string::npos)
      << found.error().message;
}

/// A UR5 whose tool nobody knows; its tip touches a point.
std::shared_ptr<const Cell> cell_of_touches() {
  const std::string text =
      "version: 1\ncell: touches\nrobot: robot.yaml\nbase: {xyz_mm: [0, 0, 0]}\ntools: {tip: "
      "null}\n"
      "anchors: {point: {xyz_mm: null, sphere_radius_mm: 0.001}}\ntracker: {sigma_mm: 0.02}\n";
  return std::make_shared<const Cell>(test::demand(parse_cell(
      text, test::demand(read_text_file(TRAMMEL_SOURCE_DIR "/models/universal-robots_ur5.yaml")),
      "cell.yaml")));
}

Gauge touch(double value) {
  Gauge gauge;
  gauge.kind = Gauge::Kind::kTouch;
  gauge.anchor = "point";
  gauge.value = value;
  return gauge;
}

TEST(Gauges, TouchesOfOnePointNameTheWayInWhichAnUnknownToolIsRead) {
  const auto touching = cell_of_touches();
  MeasurementBatch batch = test::one_point(*touching, Vector3::Zero(), Pose::Identity(), 14, 3);
  for (Measurement& m : batch.measurements) m.gauge = touch(0);
  const auto refusal = calibrate(touching, {}, batch, {});
  ASSERT_FALSE(refusal);
  for (const char* part : {"at one place in all rows", "x_mm, y_mm and z_mm, all 0", "base: null"})
    EXPECT_NE(refusal.error().next.find(part), std::string::npos) << refusal.error().next;

  // That way leads to the tool.
  for (Measurement& m : batch.measurements) {
    m.gauge.reset();
    m.p_W = Vector3::Zero();
  }
  const auto found =
      calibrate(test::cell_of_one_point("null", "null", "{error_sources: []}"), {}, batch, {});
  ASSERT_TRUE(found) << found.error().message;
  PoseContext anywhere;
  anywhere.q = JointVector::Zero(6);
  anywhere.tool = "tip";
  EXPECT_LT((found->model.state(anywhere).X_FT.translation() - Vector3(0.03, 0, 0.15)).norm(),
            1e-5);
  ASSERT_FALSE(found->unidentifiable.empty());
  EXPECT_EQ(found->unidentifiable.front().parameters,
            (std::vector<std::string>{"gamma0", "beta0", "alpha0"}));
}

TEST(Gauges, DistancesWithAnUnknownToolNameTouchesOfOnePointAmongTheWays) {
  const auto cell = cell_of_touches();
  MeasurementBatch batch = test::one_point(*cell, Vector3::Zero(), Pose::Identity(), 14, 3);
  for (Measurement& m : batch.measurements) m.gauge = touch(0.2);
  const auto refusal = calibrate(cell, {}, batch, {});
  ASSERT_FALSE(refusal);
  EXPECT_NE(refusal.error().next.find("measure some positions; or let its point touch one point"),
            std::string::npos)
      << refusal.error().next;
}

}  // namespace
}  // namespace trammel
