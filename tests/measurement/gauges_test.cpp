#include "server/measurement/gauges.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/repeats.h"
#include "tests/support/demand.h"
#include "tests/support/hidden_files.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

constexpr const char* kMixed =
    "pose_id,q1_deg,x_mm,y_mm,z_mm,distance_mm,touch_mm,anchor_id,minus_pose_id,sigma_mm\n"
    "zero,0,,,,,,,,\n"
    "wire,10,,,,1234.5,,a1,,0.2\n"
    "ball,20,,,,,-0.03,ball,,\n"
    "place,30,1,2,3,,,,,\n"
    "rel,40,,,,-0.75,,a1,zero,\n";

Refusal refusal_gauges(const std::string& text) {
  return refusal_of(parse_batch_csv(text, "wires.csv"));
}

TEST(Gauges, EachRowSaysWhatItIsAndAllKindsComeTogether) {
  const MeasurementBatch batch = test::demand(parse_batch_csv(kMixed, "wires.csv"));
  ASSERT_EQ(batch.measurements.size(), 4U)
      << "the row that others are told against is no measurement";
  const Measurement& wire = batch.measurements[0];
  ASSERT_TRUE(wire.gauge);
  EXPECT_EQ(wire.gauge->kind, Gauge::Kind::kDistance);
  EXPECT_EQ(wire.gauge->anchor, "a1");
  EXPECT_DOUBLE_EQ(wire.gauge->value, 1.2345);
  EXPECT_DOUBLE_EQ(wire.sigma.value(), 0.2e-3);
  EXPECT_FALSE(wire.p_W.allFinite()) << "nobody may take it for a position";
  EXPECT_EQ(batch.measurements[1].gauge->kind, Gauge::Kind::kTouch);
  EXPECT_FALSE(batch.measurements[2].gauge);
  EXPECT_TRUE(batch.measurements[2].p_W.isApprox(Vector3(1e-3, 2e-3, 3e-3)));
  ASSERT_TRUE(batch.measurements[3].gauge->minus);
  EXPECT_DOUBLE_EQ(batch.measurements[3].gauge->minus->q(0), 0);
  EXPECT_TRUE(has_gauges(batch));
  EXPECT_EQ(positions_of(batch).measurements.size(), 1U);
}

TEST(Gauges, AreWrittenAsTheyWereRead) {
  const MeasurementBatch batch = test::demand(parse_batch_csv(kMixed, "wires.csv"));
  const MeasurementBatch again = test::demand(parse_batch_csv(to_csv(batch), "wires.csv"));
  ASSERT_EQ(again.measurements.size(), batch.measurements.size());
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    const Measurement &a = batch.measurements[i], &b = again.measurements[i];
    EXPECT_EQ(a.pose_id, b.pose_id);
    ASSERT_EQ(a.gauge.has_value(), b.gauge.has_value());
    if (!a.gauge) continue;
    EXPECT_EQ(a.gauge->kind, b.gauge->kind);
    EXPECT_EQ(a.gauge->anchor, b.gauge->anchor);
    EXPECT_EQ(a.gauge->minus_pose, b.gauge->minus_pose);
    EXPECT_NEAR(a.gauge->value, b.gauge->value, 1e-14);
  }
}

TEST(Gauges, ARowThatIsTwoThingsOrNothingIsRefused) {
  const std::string head =
      "pose_id,q1_deg,x_mm,y_mm,z_mm,distance_mm,touch_mm,anchor_id,minus_pose_id\n";
  EXPECT_EQ(refusal_gauges(head + "a,1,1,2,3,5,,a1,\n"), Refusal("wires.csv", 2, "distance_mm"));
  EXPECT_EQ(refusal_gauges(head + "a,1,,,,5,6,a1,\n"), Refusal("wires.csv", 2, "touch_mm"));
  EXPECT_EQ(refusal_gauges(head + "a,1,,,,,,a1,\n"), Refusal("wires.csv", 2, "distance_mm"));
  EXPECT_EQ(refusal_gauges(head + "a,1,,,,-5,,a1,\n"),
            Refusal("wires.csv", 2, "distance_mm").beyond(-5, 0));
  EXPECT_EQ(refusal_gauges(head + "a,1,,,,5,,a1,b\n"),
            Refusal("wires.csv", 2, "minus_pose_id").text("b"));
  EXPECT_EQ(refusal_gauges(head + "a,1,,,,5,,a1,a\n"),
            Refusal("wires.csv", 2, "minus_pose_id").text("a"));
  EXPECT_EQ(refusal_gauges(head + "a,1,1,2,3,,,,a\n"), Refusal("wires.csv", 2, "minus_pose_id"));
  EXPECT_FALSE(parse_batch_csv(head + "a,1,1,2,,,,,\n", "wires.csv")) << "a part of a position";
}

constexpr const char* kPlaceless =
    "pose_id,q1_deg,distance_mm,anchor_id,minus_pose_id,from_pose_id\n"
    "met,10,0,spike,,\n"
    "hole,15,,,,\n"
    "bar,20,500.02,,,hole\n"
    "same,30,0,a1,met,\n";

TEST(Gauges, ATipOnASpikeAndABarBetweenTwoPosesAreRowsAndAreWrittenAsTheyWereRead) {
  const MeasurementBatch read = test::demand(parse_batch_csv(kPlaceless, "spike.csv"));
  for (const MeasurementBatch& batch :
       {read, test::demand(parse_batch_csv(to_csv(read), "spike.csv"))}) {
    ASSERT_EQ(batch.measurements.size(), 3U) << "the hole alone is no measurement";
    EXPECT_EQ(batch.measurements[0].gauge->kind, Gauge::Kind::kContact);
    EXPECT_EQ(batch.measurements[0].gauge->numbers(), 3);
    const Gauge& bar = *batch.measurements[1].gauge;
    EXPECT_EQ(bar.kind, Gauge::Kind::kApart);
    EXPECT_EQ(bar.minus_pose, "hole");
    ASSERT_TRUE(bar.minus);
    EXPECT_NEAR(bar.value, 0.50002, 1e-12);
    EXPECT_EQ(batch.measurements[2].gauge->kind, Gauge::Kind::kDistance)
        << "a difference of 0 is no contact";
  }
}

TEST(Gauges, ABarThatIsTwoThingsOrNothingIsRefused) {
  const std::string head = "pose_id,q1_deg,distance_mm,touch_mm,anchor_id,from_pose_id\n";
  const std::string other = "b,2,0,,spike,\n";
  EXPECT_EQ(refusal_gauges(head + "a,1,500,,spike,b\n" + other),
            Refusal("wires.csv", 2, "anchor_id"));
  EXPECT_EQ(refusal_gauges(head + "a,1,,3,,b\n" + other), Refusal("wires.csv", 2, "from_pose_id"));
  EXPECT_EQ(refusal_gauges(head + "a,1,0,,,b\n" + other),
            Refusal("wires.csv", 2, "distance_mm").beyond(0, 0));
  EXPECT_EQ(refusal_gauges(head + "a,1,500,,,c\n" + other),
            Refusal("wires.csv", 2, "from_pose_id").text("c"));
  EXPECT_EQ(refusal_gauges(head + "a,1,,,,b\n" + other), Refusal("wires.csv", 2, "from_pose_id"));
}

TEST(Gauges, AWireThatReadsNothingIsNoContact) {
  const std::string head = "pose_id,q1_deg,distance_mm,anchor_id\na,1,500,wire\n";
  EXPECT_EQ(refusal_gauges(head + "b,2,0,wire\n"),
            Refusal("wires.csv", 3, "distance_mm").beyond(0, 0));
  EXPECT_TRUE(parse_batch_csv(head + "b,2,0,spike\n", "wires.csv"));
}

Cell cell_with(const std::string& anchors) {
  hidden::World world;
  world.tools = {Eigen::Matrix4d::Identity()};
  world.sources = {"base"};
  const std::string text =
      hidden::cell_text(world, {world.tools, {}}, "calibration") + "anchors: " + anchors + "\n";
  return test::demand(parse_cell(text, hidden::robot_text(), "cell.yaml"));
}

std::string rows(const std::string& column, const std::string& anchor) {
  return "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg," + column + ",anchor_id\n0,0,0,0,0,0,900," +
         anchor + "\n";
}

TEST(Gauges, AnchorsAreThoseOfTheCellFileWithTheSigmaOfTheirInstrument) {
  const Cell cell = cell_with("{wire: {xyz_mm: null, sigma_mm: 0.3}}");
  const auto checked = [&](const std::string& text) {
    return check_against_cell(test::demand(parse_batch_csv(text, "w.csv")), cell);
  };
  const CheckedBatch batch = test::demand(checked(rows("distance_mm", "")));
  EXPECT_EQ(batch.rows().measurements[0].gauge->anchor, "wire") << "the only one need not be named";
  EXPECT_DOUBLE_EQ(batch.rows().measurements[0].sigma.value(), 0.3e-3);
  EXPECT_EQ(refusal_of(checked(rows("distance_mm", "wires"))),
            Refusal("w.csv", 2, "anchor_id").text("wires"));
  EXPECT_EQ(refusal_of(checked(rows("touch_mm", "wire"))),
            Refusal("w.csv", 2, "touch_mm").text("wire"));
}

TEST(Gauges, AnchorsThatMakeNoSenseAreRefused) {
  hidden::World world;
  world.tools = {Eigen::Matrix4d::Identity()};
  world.sources = {"base"};
  const auto refused_cell = [&](const std::string& anchors) {
    const std::string text =
        hidden::cell_text(world, {world.tools, {}}, "calibration") + "anchors: " + anchors + "\n";
    return !parse_cell(text, hidden::robot_text(), "cell.yaml");
  };
  EXPECT_FALSE(
      refused_cell("{a: null, b: {xyz_mm: [1, 2, 3], ring_axis: [0, 0, 2], ring_radius_mm: 25}}"));
  EXPECT_TRUE(refused_cell("{a: {xyz: [1, 2, 3]}}"));
  EXPECT_TRUE(refused_cell("{a: {xyz_mm: [1, 2]}}"));
  EXPECT_TRUE(refused_cell("{a: {sphere_radius_mm: 0}}"));
  EXPECT_FALSE(refused_cell("{a: {xyz_mm: null, plane_normal: [0, 0, 1]}}"));
  EXPECT_TRUE(refused_cell("{a: {xyz_mm: null, ring_axis: [0, 0, 1], ring_radius_mm: 25}}"));
  EXPECT_TRUE(refused_cell("{a: {xyz_mm: [1, 2, 3], plane_normal: [0, 0, 0]}}"));
  EXPECT_TRUE(refused_cell("{a: {xyz_mm: [1, 2, 3], ring_axis: [0, 0, 1]}}"));
  EXPECT_TRUE(
      refused_cell("{a: {xyz_mm: [1, 2, 3], sphere_radius_mm: 5, plane_normal: [0, 0, 1]}}"));
  EXPECT_TRUE(refused_cell("{a: {sigma_mm: -1}}"));
}

TEST(Gauges, SeveralInstrumentsAtOnePoseAreNoRepeats) {
  const std::string text =
      "pose_id,q1_deg,distance_mm,anchor_id\na,1,900,a1\nb,1,800,a2\nc,1,901,a1\n";
  const MergedRepeats merged = merge_repeats(test::demand(parse_batch_csv(text, "w.csv")), 1e-5);
  EXPECT_EQ(merged.batch.measurements.size(), 3U);
  EXPECT_EQ(merged.statistics.groups, 0);
}

TEST(Gauges, WhoWorksWithPositionsAloneSaysSoWithTheRow) {
  const MeasurementBatch batch = test::demand(parse_batch_csv(kMixed, "wires.csv"));
  const Status status = require_positions(batch, "diagnose");
  EXPECT_EQ(refusal_of(status), Refusal("wires.csv", 3, "distance_mm"));
  EXPECT_NE(status.error().message.find("diagnose works with positions alone"), std::string::npos)
      << status.error().message;
  EXPECT_TRUE(require_positions(positions_of(batch), "diagnose"));
}

}  // namespace
}  // namespace trammel
