#include "server/compensate/residual_structure.h"

#include <gtest/gtest.h>

#include "server/calibrate/calibrate.h"
#include "tests/support/demand.h"
#include "tests/support/heavy_arm.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

const std::vector<std::string> kM3 = {"base", "geometry", "compliance"};

/// A model of these sources, identified on the batch.
CompensatedModel identified(const std::shared_ptr<const Cell>& cell,
                            const std::vector<std::string>& sources,
                            const MeasurementBatch& batch) {
  CalibrationResult found = test::demand(calibrate(cell, sources, batch, {}));
  CompensatedModel::Parts parts;
  parts.physics = found.model;
  parts.parameters = found.parameters;
  parts.covariance = found.covariance;
  parts.discrepancy = found.discrepancy;
  parts.q_min = parts.q_max = batch.measurements.front().context.q;
  return test::demand(CompensatedModel::make(std::move(parts)));
}

std::optional<ResidualOrder> structure(const CompensatedModel& model,
                                       const MeasurementBatch& batch) {
  return most_structured(residual_orders(model, batch, model.errors_B(batch).calibrated));
}

TEST(ResidualStructure, NoiseHasNone) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const test::HeavyArm arm = test::draw_heavy_arm({.seed = seed, .links_weigh = false});
    const MeasurementBatch batch = test::measured(arm, 200, seed);
    EXPECT_FALSE(structure(identified(arm.cell, kM3, batch), batch)) << seed;
  }
}

TEST(ResidualStructure, ARippleThatTheModelLacksIsToldByItsJoint) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  const Eigen::Index first =
      add_source(robot.truth, test::demand(make_error_source("gear_transmission:2@9", *cell)));
  robot.truth.values.segment(first, 3) << 9, 1.5e-4, 1e-4;
  const MeasurementBatch batch = test::measured(robot, 400, 3);
  const auto told = structure(identified(cell, kM3, batch), batch);
  ASSERT_TRUE(told);
  EXPECT_EQ(told->joint, 1);
  EXPECT_GT(told->correlation, 0.3);
  EXPECT_NE(in_words(*told).find("in the order of joint 2"), std::string::npos);
}

TEST(ResidualStructure, WhatWandersWithTimeIsToldByTheRows) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 300, 4);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i)
    batch.measurements[i].p_W.z() += 5e-5 * std::sin(0.05 * static_cast<double>(i));
  const auto told = structure(identified(cell, kM3, batch), batch);
  ASSERT_TRUE(told);
  EXPECT_EQ(told->joint, -1);
  EXPECT_NE(in_words(*told).find("from row to row"), std::string::npos);
}

}  // namespace
}  // namespace trammel
