#include <gtest/gtest.h>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/measurement.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Refusal refusal(const std::string& text) {
  const auto batch = parse_batch_csv(text, "lt-07.csv");
  return refusal_of(batch);
}

constexpr const char* kEverything =
    "qz,pose_id,z_mm,q2_deg,y_mm,x_mm,q1_deg,qw,qx,qy,sigma_mm,time_s,temperature_c,tool_id,"
    "payload_id,dir1,dir2,set,operator,note\n"
    "0,a,3,20,2,1,-10,1,0,0,0.02,12.5,21.75,probe,light,-1,1,train,Ada,\"first, cold\"\n"
    "1,b,-3,-20,-2,-1,10,0,0,0,,,,,,,,validation,,\n"
    ",c,6,0,5,4,0,,,,0.03,14,22,probe,,0,0,,Ada,\n";

TEST(BatchCsv, FindsColumnsByNameInAnyOrderAndConvertsToSi) {
  const auto batch = parse_batch_csv(kEverything, "data/lt-07.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  EXPECT_EQ(batch->id, "lt-07");
  EXPECT_EQ(batch->source_text, kEverything);
  ASSERT_EQ(batch->measurements.size(), 3u);
  const Measurement& first = batch->measurements[0];
  EXPECT_EQ(first.pose_id, "a");
  EXPECT_EQ(first.row, 2);
  EXPECT_DOUBLE_EQ(first.context.q(0), from_deg(-10));
  EXPECT_DOUBLE_EQ(first.context.q(1), from_deg(20));
  EXPECT_TRUE(first.p_W.isApprox(Vector3(0.001, 0.002, 0.003)));
  EXPECT_TRUE(first.R_WT.value().isApprox(Matrix3::Identity()));
  EXPECT_DOUBLE_EQ(first.sigma.value(), 2e-5);
  EXPECT_DOUBLE_EQ(first.context.time.value(), 12.5);
  EXPECT_DOUBLE_EQ(first.context.temperature.value(), 21.75);
  EXPECT_EQ(first.context.tool, "probe");
  EXPECT_EQ(first.context.payload, "light");
  EXPECT_EQ(first.context.direction, (std::vector<int>{-1, 1}));
  EXPECT_EQ(first.set, MeasurementSet::kTrain);
  EXPECT_EQ(batch->measurements[2].context.index, 2);
}

TEST(BatchCsv, KeepsColumnsThatItDoesNotKnow) {
  const auto batch = parse_batch_csv(kEverything, "lt-07.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  EXPECT_EQ(batch->extra_columns, (std::vector<std::string>{"operator", "note"}));
  EXPECT_EQ(batch->measurements[0].extra, (std::vector<std::string>{"Ada", "first, cold"}));
}

TEST(BatchCsv, AnEmptyOptionalFieldMeansNotRecorded) {
  const auto batch = parse_batch_csv(kEverything, "lt-07.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  const Measurement& second = batch->measurements[1];
  EXPECT_FALSE(second.sigma);
  EXPECT_FALSE(second.context.time);
  EXPECT_FALSE(second.context.temperature);
  EXPECT_EQ(second.context.tool, "");
  EXPECT_EQ(second.context.direction, (std::vector<int>{0, 0}));
  EXPECT_TRUE(second.R_WT);
  EXPECT_FALSE(batch->measurements[2].R_WT);
  EXPECT_EQ(batch->measurements[2].set, MeasurementSet::kUnassigned);
}

TEST(BatchCsv, CountsPosesWhereNoneIsNamed) {
  const auto batch = parse_batch_csv("q1_deg,x_mm,y_mm,z_mm\n1,2,3,4\n5,6,7,8\n", "b.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  EXPECT_EQ(batch->measurements[0].pose_id, "1");
  EXPECT_EQ(batch->measurements[1].pose_id, "2");
}

TEST(BatchCsv, ReadsARailInMillimetres) {
  const auto batch = parse_batch_csv("q1_mm,q2_deg,x_mm,y_mm,z_mm\n1500,90,2,3,4\n", "b.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  EXPECT_EQ(batch->joint_types,
            (std::vector<JointType>{JointType::kPrismatic, JointType::kRevolute}));
  EXPECT_DOUBLE_EQ(batch->measurements[0].context.q(0), 1.5);
  EXPECT_DOUBLE_EQ(batch->measurements[0].context.q(1), kPi / 2);
}

TEST(BatchCsv, RefusesMissingColumnsByName) {
  EXPECT_EQ(refusal(""), Refusal("lt-07.csv").beyond(0, 1));
  EXPECT_EQ(refusal("q1_deg,x_mm,y_mm,z_mm\n"), Refusal("lt-07.csv").beyond(0, 1));
  EXPECT_EQ(refusal("q1_deg,x_mm,y_mm\n1,2,3\n"), Refusal("lt-07.csv", {}, "z_mm"));
  EXPECT_EQ(refusal("x_mm,y_mm,z_mm\n1,2,3\n"), Refusal("lt-07.csv", {}, "q1_deg"));
  EXPECT_EQ(refusal("q1_deg,q3_deg,x_mm,y_mm,z_mm\n1,1,1,2,3\n"),
            Refusal("lt-07.csv", {}, "q2_deg"));
  EXPECT_EQ(refusal("q1_deg,q1_mm,x_mm,y_mm,z_mm\n1,1,1,2,3\n"), Refusal("lt-07.csv", {}, "q1_mm"));
  EXPECT_EQ(refusal("q1_deg,x_mm,y_mm,z_mm,qw,qx,qz\n1,1,2,3,1,0,0\n"),
            Refusal("lt-07.csv", {}, "qy"));
  EXPECT_EQ(refusal("q1_deg,q2_deg,dir2,x_mm,y_mm,z_mm\n1,1,1,1,2,3\n"),
            Refusal("lt-07.csv", {}, "dir1"));
}

/// A batch of two rows of which the second has `value` in `column`.
std::string with(const std::string& column, const std::string& value) {
  const std::vector<std::pair<std::string, std::string>> good = {
      {"pose_id", "p1"},  {"q1_deg", "10"}, {"x_mm", "1"}, {"y_mm", "2"},
      {"z_mm", "3"},      {"qw", "1"},      {"qx", "0"},   {"qy", "0"},
      {"sigma_mm", ".1"}, {"qz", "0"},      {"dir1", "1"}, {"set", "train"}};
  std::string header, first, second;
  for (const auto& [name, text] : good) {
    header += name + ",";
    first += text + ",";
    second += (name == column ? value : name == "pose_id" ? "p2" : text) + ",";
  }
  return header + "end\n" + first + "\n" + second + "\n";
}

TEST(BatchCsv, TheRowThatTheRefusalsStartFromIsGood) {
  EXPECT_EQ(refusal(with("x_mm", "4")), Refusal::none());
}

TEST(BatchCsv, RefusesBadValuesWithRowColumnValueAndLimit) {
  EXPECT_EQ(refusal(with("q1_deg", "nan")), Refusal("lt-07.csv", 3, "q1_deg").text("nan"));
  EXPECT_EQ(refusal(with("q1_deg", "")), Refusal("lt-07.csv", 3, "q1_deg"));
  EXPECT_EQ(refusal(with("y_mm", "inf")), Refusal("lt-07.csv", 3, "y_mm").text("inf"));
  EXPECT_EQ(refusal(with("y_mm", "2e6")), Refusal("lt-07.csv", 3, "y_mm").beyond(2e+06, 1e+06));
  EXPECT_EQ(refusal(with("y_mm", "12;5")), Refusal("lt-07.csv", 3, "y_mm").text("12;5"));
  EXPECT_EQ(refusal(with("qw", "1.01")), Refusal("lt-07.csv", 3, "qw").beyond(1.01, 1));
  EXPECT_EQ(refusal(with("qw", "")), Refusal("lt-07.csv", 3, "qw"));
  EXPECT_EQ(refusal(with("sigma_mm", "0")), Refusal("lt-07.csv", 3, "sigma_mm").beyond(0, 0));
  EXPECT_EQ(refusal(with("sigma_mm", "-1")), Refusal("lt-07.csv", 3, "sigma_mm").beyond(-1, 0));
  EXPECT_EQ(refusal(with("dir1", "2")), Refusal("lt-07.csv", 3, "dir1").beyond(2, 1));
  EXPECT_EQ(refusal(with("set", "test")), Refusal("lt-07.csv", 3, "set").text("test"));
  EXPECT_EQ(refusal(with("pose_id", "p1")), Refusal("lt-07.csv", 3, "pose_id").text("p1"));
}

TEST(BatchCsv, NormalisesAQuaternionWithinTheLimit) {
  const auto batch = parse_batch_csv(with("qw", "1.0009"), "b.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  EXPECT_TRUE(batch->measurements[1].R_WT->isUnitary(1e-12));
}

TEST(BatchCsv, WhatIsWrittenReadsBackTheSame) {
  const auto batch = parse_batch_csv(kEverything, "lt-07.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  const auto again = parse_batch_csv(to_csv(*batch), "lt-07.csv");
  ASSERT_TRUE(again) << again.error().message;
  ASSERT_EQ(again->measurements.size(), batch->measurements.size());
  EXPECT_EQ(again->extra_columns, batch->extra_columns);
  for (std::size_t i = 0; i < batch->measurements.size(); ++i) {
    const Measurement& before = batch->measurements[i];
    const Measurement& after = again->measurements[i];
    EXPECT_EQ(after.pose_id, before.pose_id);
    EXPECT_TRUE(after.context.q.isApprox(before.context.q, 1e-11));
    EXPECT_TRUE(after.p_W.isApprox(before.p_W, 1e-11));
    ASSERT_EQ(after.R_WT.has_value(), before.R_WT.has_value());
    EXPECT_TRUE(!before.R_WT || after.R_WT->isApprox(*before.R_WT, 1e-11));
    ASSERT_EQ(after.sigma.has_value(), before.sigma.has_value());
    EXPECT_NEAR(after.sigma.value_or(0), before.sigma.value_or(0), 1e-15);
    EXPECT_EQ(after.context.time, before.context.time);
    EXPECT_EQ(after.context.temperature, before.context.temperature);
    EXPECT_EQ(after.context.direction, before.context.direction);
    EXPECT_EQ(after.context.tool, before.context.tool);
    EXPECT_EQ(after.context.payload, before.context.payload);
    EXPECT_EQ(after.set, before.set);
    EXPECT_EQ(after.extra, before.extra);
  }
}

TEST(BatchCsv, WritesNoColumnThatNoRowHas) {
  const auto batch = parse_batch_csv("q1_deg,x_mm,y_mm,z_mm\n1,2,3,4\n", "b.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  EXPECT_EQ(to_csv(*batch), "pose_id,q1_deg,x_mm,y_mm,z_mm\n1,1,2,3,4\n");
}

TEST(BatchCsv, RefusesAFileThatIsNotThere) {
  const auto batch = read_batch_csv("/nowhere/b.csv");
  ASSERT_FALSE(batch);
  EXPECT_EQ(refusal_of(batch), Refusal("/nowhere/b.csv"));
  EXPECT_EQ(batch.error().code, ErrorCode::kRefused);
}

}  // namespace
}  // namespace trammel
