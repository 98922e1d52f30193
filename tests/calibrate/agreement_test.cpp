#include "server/calibrate/agreement.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "tests/support/demand.h"
#include "tests/support/gauged_arm.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

const std::vector<std::string> kM3 = {"base", "geometry", "compliance"};

std::optional<Agreement> agreement(const std::shared_ptr<const Cell>& cell,
                                   const std::vector<std::string>& sources,
                                   const MeasurementBatch& batch) {
  return agreement_of(cell, sources, batch, calibrate(cell, sources, batch, {}));
}

MeasurementBatch positions(int poses, std::uint64_t seed) {
  MeasurementBatch batch =
      test::measured(test::chapter_5_robot(test::cell_7()), poses, seed, false);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i)
    batch.measurements[i].row = static_cast<int>(i) + 2;
  return batch;
}

/// Spoils so many rows, drawn, by about `off` (m); which.
std::set<int> spoil(MeasurementBatch& batch, double share, double off, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<std::size_t> order(batch.measurements.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), random);
  std::set<int> rows;
  for (std::size_t k = 0; static_cast<double>(k) + 1 <= share * static_cast<double>(order.size());
       ++k) {
    Measurement& m = batch.measurements[order[k]];
    Vector3 direction(normal(random), normal(random), normal(random));
    m.p_W += off * direction.normalized();
    rows.insert(m.row);
  }
  return rows;
}

std::set<int> rows_of(const MeasurementBatch& batch) {
  std::set<int> rows;
  for (const Measurement& m : batch.measurements) rows.insert(m.row);
  return rows;
}

/// The rows that are named: left out, or suspects where a fit on all bounds them.
std::set<int> named(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch) {
  const auto plain = calibrate(cell, kM3, batch, {});
  if (const auto found = agreement_of(cell, kM3, batch, plain)) return rows_of(found->others);
  std::set<int> rows;
  if (plain)
    for (const SuspectPose& pose : plain->suspects) rows.insert(pose.row);
  return rows;
}

TEST(Agreement, UpToTwoRowsInFiveMayBeBadAndEachOfThemIsNamed) {
  const auto cell = test::cell_7();
  for (const double share : {0.2, 0.3, 0.4}) {
    for (const double off : {3e-3, 30e-3, 0.3}) {
      MeasurementBatch batch = positions(60, 11);
      const std::set<int> bad = spoil(batch, share, off, 5);
      EXPECT_EQ(named(cell, batch), bad) << share << ", " << off;
    }
  }
}

/// The shipped cell that does not say where its base is, or its tool.
std::shared_ptr<const Cell> cell_without(bool base, bool tool) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  if (base) cell->X_WB.reset();
  if (tool) cell->tools["spindle"].reset();
  return cell;
}

/// As an instrument sees them that stands anywhere.
void see_from_elsewhere(MeasurementBatch& batch, double angle) {
  const Pose X = pose_zyx({2.5, -1.5, 0.4}, angle, 0.02, -0.03);
  for (Measurement& m : batch.measurements) m.p_W = X * m.p_W;
}

TEST(Agreement, RowsThatAreFarOffLeadToNoArmWhereBaseOrToolAreUnknownAndAreNamedAllTheSame) {
  for (const auto& [base, tool] :
       {std::pair(true, false), std::pair(false, true), std::pair(true, true)}) {
    const auto cell = cell_without(base, tool);
    for (const double share : {0.2, 0.4}) {
      MeasurementBatch batch = positions(60, 13);
      if (base) see_from_elsewhere(batch, 1.9);
      const std::set<int> bad = spoil(batch, share, 1, 7);
      EXPECT_FALSE(calibrate(cell, kM3, batch, {})) << "no fit on all rows leads anywhere";
      EXPECT_EQ(named(cell, batch), bad)
          << "base unknown " << base << ", tool unknown " << tool << ", " << share;
    }
  }
}

TEST(Agreement, EachOfSeveralSessionsIsAskedByItself) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = positions(60, 14), earlier = positions(50, 15);
  std::set<int> bad = spoil(batch, 0.3, 20e-3, 8);
  const std::set<int> bad_earlier = spoil(earlier, 0.4, 0.5, 9);
  see_from_elsewhere(earlier, -0.7);
  for (Measurement& m : earlier.measurements) {
    if (bad_earlier.contains(m.row)) bad.insert(m.row + 1000);
    m.row += 1000;
  }
  for (Measurement& m : batch.measurements) m.session = 1;
  batch.measurements.insert(batch.measurements.begin(), earlier.measurements.begin(),
                            earlier.measurements.end());
  batch.sessions = {"earlier", "newest"};
  for (std::size_t i = 0; i < batch.measurements.size(); ++i)
    batch.measurements[i].context.index = static_cast<int>(i);
  const auto found = agreement(cell, kM3, batch);
  ASSERT_TRUE(found);
  EXPECT_EQ(rows_of(found->others), bad);
  CalibrationResult good = test::demand(calibrate(cell, kM3, found->agreeing, {}));
  EXPECT_LT(to_mm(good.rms), 0.05);
  add_suspects(found->others, good);
  for (const SuspectPose& pose : good.suspects)
    EXPECT_NEAR(to_mm(pose.distance), pose.row > 1000 ? 500 : 20, 0.5) << "row " << pose.row;
}

TEST(Agreement, TwoReflectorsThatWereExchangedInAQuarterOfThePosesAreFound) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  const Pose spindle = *cell->tools.at("spindle");
  cell->tools = {{"a", spindle}, {"b", spindle}, {"c", spindle}};
  cell->tools["b"]->translation() += Vector3(0.1, -0.05, 0.12);
  cell->tools["c"]->translation() += Vector3(-0.08, 0.1, 0.05);
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const Eigen::MatrixXd q = test::demand(plan_poses(*cell, {32, 3}));
  MeasurementBatch batch;
  for (const char* tool : {"a", "b", "c"}) {
    SimulateOptions options;
    options.seed = 7;
    options.orientation = false;
    options.tool = tool;
    options.payload = "spindle";
    for (Measurement& m : test::demand(simulate(robot, q, options)).measurements) {
      m.row = static_cast<int>(batch.measurements.size()) + 2;
      batch.measurements.push_back(std::move(m));
    }
  }
  for (Measurement& m : batch.measurements)
    m.p_W += 20e-6 * Vector3(std::sin(m.row), std::cos(m.row), 0);
  std::set<int> exchanged;
  for (std::size_t i = 0; i < 32; i += 4) {
    std::swap(batch.measurements[32 + i].p_W, batch.measurements[64 + i].p_W);
    for (const std::size_t row : {32 + i, 64 + i}) exchanged.insert(batch.measurements[row].row);
  }
  const auto found = agreement(cell, kM3, batch);
  ASSERT_TRUE(found);
  EXPECT_EQ(rows_of(found->others), exchanged);
}

/// Draw wires from three corners, some of which told too much or too little by about `off_mm`;
/// which.
std::set<int> spoil(std::vector<test::GaugeRow>& rows, double share, double off_mm,
                    std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<std::size_t> order(rows.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), random);
  std::set<int> bad;
  for (std::size_t k = 0; static_cast<double>(k) + 1 <= share * static_cast<double>(order.size());
       ++k) {
    rows[order[k]].value_mm +=
        (normal(random) > 0 ? 1 : -1) * off_mm * (1 + 0.3 * std::abs(normal(random)));
    bad.insert(static_cast<int>(order[k]) + 2);
  }
  return bad;
}

TEST(Agreement, BadDistancesAreNamedAsBadPositionsAre) {
  for (const bool known : {true, false}) {
    const std::string places = known ? "" : test::unknown_places(test::three_corners());
    const test::GaugedArm arm = test::gauged_arm(3, test::three_corners(), places);
    for (const double share : {0.1, 0.2, 0.3, 0.4}) {
      for (const double off_mm : {3.0, 30.0, 200.0}) {
        std::vector<test::GaugeRow> rows = test::wire_rows(arm, 240, 3);
        const std::set<int> bad = spoil(rows, share, off_mm, 4);
        EXPECT_EQ(named(arm.cell, test::gauge_batch(arm, rows, 0.05, 3)), bad)
            << (known ? "known, " : "unknown, ") << share << ", " << off_mm;
      }
    }
  }
}

TEST(Agreement, DistancesThatAreFarOffAmongFewAreNamed) {
  for (const bool known : {true, false}) {
    const std::string places = known ? "" : test::unknown_places(test::three_corners());
    for (std::uint64_t seed = 3; seed <= 4; ++seed) {
      const test::GaugedArm arm = test::gauged_arm(seed, test::three_corners(), places);
      for (const double share : {0.02, 0.1}) {
        for (const double off_mm : {120.0, 400.0}) {
          std::vector<test::GaugeRow> rows = test::wire_rows(arm, 60, seed);
          const std::set<int> bad = spoil(rows, share, off_mm, 4);
          EXPECT_EQ(named(arm.cell, test::gauge_batch(arm, rows, 0.05, seed)), bad)
              << (known ? "known, " : "unknown, ") << share << ", " << off_mm << ", seed " << seed;
        }
      }
      const std::vector<test::GaugeRow> good = test::wire_rows(arm, 60, seed);
      EXPECT_FALSE(agreement(arm.cell, kM3, test::gauge_batch(arm, good, 0.05, seed)))
          << "seed " << seed;
    }
  }
}

TEST(Agreement, AGoodBatchIsNotAsked) {
  EXPECT_FALSE(agreement(test::cell_7(), kM3, positions(60, 21)));
}

TEST(Agreement, AModelThatLacksSomethingHasNoBadRows) {
  const auto cell = test::cell_7();
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    for (const std::vector<std::string>& sources :
         {std::vector<std::string>{}, {"base"}, {"base", "geometry"}, {"geometry"}})
      EXPECT_FALSE(agreement(cell, sources, positions(80, seed)))
          << sources.size() << ", seed " << seed;
  }
}

TEST(Agreement, JointsInWholeDegreesAreNoBadRows) {
  MeasurementBatch batch = positions(80, 31);
  for (Measurement& m : batch.measurements)
    for (double& q : m.context.q) q = from_deg(std::round(to_deg(q)));
  EXPECT_FALSE(agreement(test::cell_7(), kM3, batch));
}

TEST(Agreement, WhatDoesNotAgreeIsNamedWithItsRowAndDistance) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = positions(60, 41);
  const std::set<int> bad = spoil(batch, 0.3, 30e-3, 6);
  const auto found = agreement(cell, kM3, batch);
  ASSERT_TRUE(found);
  CalibrationResult good = test::demand(calibrate(cell, kM3, found->agreeing, {}));
  EXPECT_LT(to_mm(good.rms), 0.05);
  add_suspects(found->others, good);
  ASSERT_EQ(good.suspects.size(), bad.size());
  for (const SuspectPose& pose : good.suspects) {
    EXPECT_TRUE(bad.contains(pose.row));
    EXPECT_NEAR(to_mm(pose.distance), 30, 0.2);
  }
}

}  // namespace
}  // namespace trammel
