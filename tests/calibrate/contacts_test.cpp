// Contacts with a spike, bars between two poses and planes of unknown place, against a second
// kinematics.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/calibrate/gauges/gauge_doubt.h"
#include "server/calibrate/identify/weighted_pose.h"
#include "server/error_sources/anchors.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/gauged_arm.h"

namespace trammel {
namespace {

const std::vector<std::string> kArmOfContacts = {"base", "geometry", "compliance"};
constexpr double kNoiseOfContacts = 0.05;  // mm

std::string limits_of(const CalibrationResult& result) {
  std::string text;
  for (const UnidentifiableCombination& one : result.unidentifiable) text += one.sentence + "\n";
  return text;
}

const std::map<std::string, Eigen::Vector3d> kSpike = {{"spike", {1700, 200, 900}}};

TEST(Gauges, SixtyContactsWithOneSpikeAndOneBarTellTheArmAsWellAsTheyCan) {
  double missed = 0, least = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const test::GaugedArm arm = test::gauged_arm(seed, kSpike, test::unknown_places(kSpike));
    std::vector<test::GaugeRow> rows = test::contact_rows(arm, "spike", 60, kNoiseOfContacts, seed);
    test::add_bar(arm, 800, seed, rows);
    const auto found = calibrate(arm.cell, kArmOfContacts,
                                 test::gauge_batch(arm, rows, kNoiseOfContacts, seed), {});
    ASSERT_TRUE(found) << found.error().message;
    missed += std::pow(test::volumetric_mm(arm, *found, true, 1000 + seed), 2);
    least += std::pow(
        test::least_volumetric_mm(arm, rows, kNoiseOfContacts, false, true, 1000 + seed), 2);
    EXPECT_NE(limits_of(*found).find("do not tell where the base stands"), std::string::npos);
    EXPECT_EQ(limits_of(*found).find("an arm of every size"), std::string::npos)
        << "the bar tells the size";
  }
  test::tell_figure("60 contacts and a bar over the bound", std::sqrt(missed / least));
  EXPECT_LE(std::sqrt(missed / least), 1.1);
}

TEST(Gauges, ContactsAloneSayThatTheyDoNotTellTheSizeOfTheArm) {
  const test::GaugedArm arm = test::gauged_arm(2, kSpike, test::unknown_places(kSpike));
  const auto rows = test::contact_rows(arm, "spike", 60, kNoiseOfContacts, 2);
  const auto found =
      calibrate(arm.cell, kArmOfContacts, test::gauge_batch(arm, rows, kNoiseOfContacts, 2), {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_NE(limits_of(*found).find("an arm of every size"), std::string::npos) << limits_of(*found);
  EXPECT_LT(to_mm(found->rms), 2 * kNoiseOfContacts);
}

const std::map<std::string, Eigen::Vector3d> kOpenTable = {{"table", {1500, 0, 200}}};
const Eigen::Vector3d kTilted(0.6, 0, 0.8);

/// Touches of a tilted table of unknown place, some above it.
std::vector<test::GaugeRow> table_rows(const test::GaugedArm& arm, int count, std::uint64_t seed) {
  std::vector<test::GaugeRow> rows = test::position_rows(arm, count, seed);
  for (test::GaugeRow& row : rows) {
    row.anchor = "table", row.column = "touch_mm";
    row.value_mm = (row.p_mm - kOpenTable.at("table")).dot(kTilted);
  }
  return rows;
}

test::GaugedArm arm_beside_open_table(std::uint64_t seed) {
  return test::gauged_arm(seed, kOpenTable,
                          "{table: {xyz_mm: null, plane_normal: [0.5, 0.1, 0.9]}}");
}

TEST(Gauges, DerivativesAreExactForContactsBarsAndPlanesOfUnknownPlace) {
  const test::GaugedArm arm = test::gauged_arm(
      6, {{"spike", {1700, 200, 900}}, {"table", {1500, 0, 200}}},
      "{spike: {xyz_mm: null}, table: {xyz_mm: null, plane_normal: [0.5, 0.1, 0.9]}}");
  std::vector<test::GaugeRow> rows = test::contact_rows(arm, "spike", 3, kNoiseOfContacts, 6);
  test::add_bar(arm, 500, 6, rows);
  for (test::GaugeRow& row : table_rows(arm, 3, 6)) rows.push_back(row);
  const MeasurementBatch batch = test::gauge_batch(arm, rows, kNoiseOfContacts, 6);
  ASSERT_EQ(batch.measurements.size(), 7U);
  PhysicalModel model =
      test::demand(make_physical_model(arm.cell, {"base", "geometry", "compliance", "anchors"}));
  model.values.segment<3>(placed_anchor(model, "spike").place) << 1.7, 0.2, 0.9;
  model.values.segment<3>(placed_anchor(model, "table").place) << 1.06, 0.1, -0.2;
  const ScaledParameters s = scaled_parameters(model, {});
  for (const Measurement& m : batch.measurements) {
    const WeightedPose pose(model, s, m, {});
    const Eigen::Index n = m.gauge->numbers();
    ASSERT_EQ(pose.size(), n);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> J(n, s.prior.size());
    Eigen::VectorXd at(n), above(n), below(n);
    ASSERT_TRUE(pose.evaluate(s.prior.data(), at.data(), J.data()));
    for (Eigen::Index k = 0; k < s.prior.size(); ++k) {
      constexpr double kStep = 1e-5;
      Eigen::VectorXd up = s.prior, down = s.prior;
      up(k) += kStep, down(k) -= kStep;
      ASSERT_TRUE(pose.evaluate(up.data(), above.data(), nullptr) &&
                  pose.evaluate(down.data(), below.data(), nullptr));
      const Eigen::VectorXd numeric = (above - below) / (2 * kStep);
      EXPECT_LE((J.col(k) - numeric).norm(), 1e-4 * std::max(1.0, numeric.norm()))
          << m.pose_id << " " << k;
    }
  }
}

TEST(Gauges, ATableThatNobodyMeasuredIsFoundByItsTouches) {
  const test::GaugedArm arm = arm_beside_open_table(8);
  const auto found =
      calibrate(arm.cell, {"geometry"},
                test::gauge_batch(arm, table_rows(arm, 80, 8), kNoiseOfContacts, 8), {});
  ASSERT_TRUE(found) << found.error().message;
  const Anchor table = placed_anchor(found->model, "table").at(found->model.values);
  // The drawn base is some mm and mrad from the real one, and the table is told from there.
  EXPECT_LT(std::acos(std::min(1.0, table.direction_W.dot(kTilted))), 0.02);
  EXPECT_NEAR(table.direction_W.dot(*table.p_W), from_mm(1) * 1060, from_mm(40));
  EXPECT_TRUE(std::none_of(found->parameters.begin(), found->parameters.end(), [](const auto& one) {
    return one.parameter.name == "zero[table]";
  })) << "the offset has it";
}

TEST(Gauges, ABarInInchesIsDoubtedAndOneInMillimetresIsNot) {
  const test::GaugedArm arm = test::gauged_arm(3, kSpike, test::unknown_places(kSpike));
  std::vector<test::GaugeRow> rows = test::contact_rows(arm, "spike", 4, kNoiseOfContacts, 3);
  test::add_bar(arm, 800, 3, rows);
  EXPECT_FALSE(gauge_doubt(test::gauge_batch(arm, rows, kNoiseOfContacts, 3), *arm.cell));
  rows.back().value_mm /= 25.4;
  const auto doubt = gauge_doubt(test::gauge_batch(arm, rows, 0.001, 3), *arm.cell);
  ASSERT_TRUE(doubt);
  EXPECT_NE(doubt->message.find("inch"), std::string::npos) << doubt->message;
}

TEST(Gauges, OneContactAndAPointThatTheCellDoesNotHaveAreRefusedByTraining) {
  const test::GaugedArm arm = test::gauged_arm(3, kSpike, test::unknown_places(kSpike));
  std::vector<test::GaugeRow> rows = test::contact_rows(arm, "spike", 1, kNoiseOfContacts, 3);
  const auto once = calibrate(arm.cell, kArmOfContacts, test::gauge_batch(arm, rows, 0.05, 3), {});
  ASSERT_FALSE(once);
  EXPECT_NE(once.error().message.find("met it once"), std::string::npos) << once.error().message;
  rows.front().anchor = "another";
  const auto other = calibrate(arm.cell, kArmOfContacts, test::gauge_batch(arm, rows, 0.05, 3), {});
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().message.find("no anchor 'another'"), std::string::npos);
}

}  // namespace
}  // namespace trammel
