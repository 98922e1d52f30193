#include "clients/cli/service/answers.h"

#include <gtest/gtest.h>

#include <limits>

#include "server/compensate/exchanged.h"
#include "server/measurement/files/csv_table.h"

namespace trammel::cli {
namespace {

TargetFile targets(int count) {
  TargetFile file{"t.csv", {}, {}};
  for (int i = 0; i < count; ++i) file.rows.push_back({i + 2, {}});
  return file;
}

exchange::CorrectedTarget corrected(const std::string& status) {
  exchange::CorrectedTarget target;
  target.status = status;
  target.commanded = {1, 2, 3, .5, .5, -.5, .5};
  target.joints_deg = {90, 250};
  target.error_before_mm = 1.5;
  target.error_after_mm = 1e-5;
  target.sigma_mm = .04;
  target.sigma_measured_mm = .05;
  target.turn_before_deg = 90;
  target.iterations = 3;
  target.message = status == "ok" ? "" : "because, so";
  return target;
}

const std::vector<JointType> kTypes = {JointType::kRevolute, JointType::kPrismatic};

TEST(Answers, CorrectionsAreWrittenWithRowStatusPoseJointsAndErrors) {
  EXPECT_EQ(
      corrections_csv(targets(1), {"abc", kTypes, {corrected("ok")}}),
      "row,status,x_mm,y_mm,z_mm,qw,qx,qy,qz,q1_deg,q2_mm,error_before_mm,error_after_mm,sigma_mm,"
      "iterations,model_id,message,sigma_measured_mm,turn_before_deg,turn_after_deg\n"
      "2,ok,1,2,3,0.5,0.5,-0.5,0.5,90,250,1.5,1e-05,0.04,3,abc,,0.05,90,0\n");
}

/// The table that corrections of these targets are written as.
CsvTable written(const TargetFile& file, const Corrections& corrections) {
  return CsvTable::parse(corrections_csv(file, corrections), "c.csv").value();
}

std::string field(const CsvTable& table, const std::string& column) {
  return table.field(0, table.require(column).value());
}

TEST(Answers, ATargetWithoutACorrectionHasNoNumbersThatCouldBeCommanded) {
  for (const char* status :
       {"unreachable", "joint_limit", "singular", "not_converged", "refused"}) {
    const CsvTable table = written(targets(1), {"abc", kTypes, {corrected(status)}});
    for (std::size_t column = 2; column <= 10; ++column)
      EXPECT_EQ(table.field(0, column), "") << status;
    EXPECT_EQ(field(table, "message"), "because, so");
    EXPECT_FALSE(
        corrections_json(targets(1), {"abc", kTypes, {corrected(status)}})["targets"][0].contains(
            "commanded"));
  }
}

TEST(Answers, ATargetLeftAloneSaysWhatErrorToExpectWhereSomethingCanBeSaid) {
  exchange::CorrectedTarget left = corrected("joint_limit");
  left.error_after_mm = left.error_before_mm;
  EXPECT_EQ(field(written(targets(1), {"abc", kTypes, {left}}), "error_before_mm"), "1.5");
  EXPECT_EQ(field(written(targets(1), {"abc", kTypes, {left}}), "error_after_mm"), "1.5");
  left.error_before_mm = left.error_after_mm = left.sigma_mm =
      std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(field(written(targets(1), {"abc", kTypes, {left}}), "error_after_mm"), "");
  EXPECT_TRUE(corrections_json(targets(1), {"abc", kTypes, {left}})["targets"][0]["error_after_mm"]
                  .is_null());
}

TEST(Answers, TheUsersColumnsComeFirstAsTheyWereAndNoneIsNamedTwice) {
  const std::string text =
      "hole,\"name, long\",status,X_mm,input_status,conf,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
      "\"#1\",\"a \"\"b\"\"\nc\",old,7,before,3,1.50,2,3,1,0,0,0\n";
  const TargetFile file = parse_targets_csv(text, "t.csv").value();
  const CsvTable table = written(file, {"abc", kTypes, {corrected("ok")}});
  EXPECT_EQ(std::vector<std::string>(table.columns().begin(), table.columns().begin() + 15),
            (std::vector<std::string>{"hole", "name, long", "input_input_status", "input_X_mm",
                                      "input_status", "conf", "input_input_x_mm", "input_y_mm",
                                      "input_z_mm", "input_qw", "input_qx", "input_qy", "input_qz",
                                      "row", "status"}));
  EXPECT_EQ(field(table, "hole"), "#1");
  EXPECT_EQ(field(table, "name, long"), "a \"b\"\nc");
  EXPECT_EQ(field(table, "input_input_status"), "old");
  EXPECT_EQ(field(table, "input_status"), "before");
  EXPECT_EQ(field(table, "input_input_x_mm"), "1.50") << "as it stood there";
  EXPECT_EQ(field(table, "x_mm"), "1") << "ours";
  EXPECT_EQ(field(table, "status"), "ok");
  EXPECT_EQ(field(table, "row"), "2");
  const auto json = corrections_json(file, {"abc", kTypes, {corrected("ok")}});
  EXPECT_EQ(json["targets"][0]["input"]["hole"], "#1");
  EXPECT_EQ(json["targets"][0]["input"]["x_mm"], "1.50");
}

TEST(Answers, WhatIsLeftAloneIsNamedByFileRowAndReason) {
  EXPECT_EQ(
      left_alone_text(targets(2), {"abc", kTypes, {corrected("ok"), corrected("out_of_domain")}}),
      "");
  EXPECT_EQ(
      left_alone_text(targets(2), {"abc", kTypes, {corrected("ok"), corrected("joint_limit")}}),
      "1 of 2 targets are left as they were:\n  t.csv row 3: joint_limit: because, so\n");
  const Corrections many{"abc", kTypes,
                         std::vector<exchange::CorrectedTarget>(12, corrected("unreachable"))};
  EXPECT_NE(left_alone_text(targets(12), many).find("  and 2 more\n"), std::string::npos);
}

TEST(Answers, OutOfDomainIsACorrectionAndSaysSo) {
  const std::string text =
      corrections_csv(targets(1), {"abc", kTypes, {corrected("out_of_domain")}});
  const CsvTable table = CsvTable::parse(text, "c.csv").value();
  EXPECT_EQ(table.field(0, 1), "out_of_domain");
  EXPECT_EQ(table.field(0, 2), "1");
}

TEST(Answers, TheSummaryCountsStatuses) {
  EXPECT_EQ(corrections_summary(
                {"abc", kTypes, {corrected("ok"), corrected("unreachable"), corrected("ok")}}),
            "3 targets: 2 ok, 1 unreachable\n");
}

TEST(Answers, PredictionsAreWrittenWithTheirPinnedColumnsFirst) {
  JointList list{"j.csv", kTypes, {CommandedPose{}}};
  list.poses[0].pose_id = "p, 1";
  exchange::Prediction item;
  item.predicted = {1, 2, 3, 1, 0, 0, 0};
  item.error_mm[0] = .5;
  item.stddev_mm[0] = .25;
  item.true_stddev_mm[0] = .125;
  item.in_domain = true;
  EXPECT_EQ(predictions_csv(list, {"abc", {item}}),
            "dx_mm,dy_mm,dz_mm,sx_mm,sy_mm,sz_mm,in_domain,x_mm,y_mm,z_mm,qw,qx,qy,qz,pose_id,"
            "model_id,slx_mm,sly_mm,slz_mm\n"
            "0.5,0,0,0.25,0,0,1,1,2,3,1,0,0,0,\"p, 1\",abc,0.125,0,0\n");
  EXPECT_EQ(predictions_json(list, {"abc", {item}})["predictions"][0]["slx_mm"], .125);
  EXPECT_EQ(predictions_json(list, {"abc", {item}})["predictions"][0]["dx_mm"], .5);
}

TEST(Answers, CovariancesAreAppendedWhereAskedForAndTheTrueErrorsStddevAlways) {
  ErrorPrediction prediction;
  prediction.covariance_B << 4e-8, 1e-8, -2e-8, 1e-8, 9e-8, 3e-8, -2e-8, 3e-8, 16e-8;
  prediction.true_stddev_B = Vector3(1e-4, 2e-4, 3e-4);
  JointList list;
  list.poses.push_back(CommandedPose{});
  const Predictions with{"abc", {exchanged(prediction)}, {}, true};
  const CsvTable table = CsvTable::parse(predictions_csv(list, with), "p.csv").value();
  const std::string without = predictions_csv(list, {"abc", {exchange::Prediction{}}});
  EXPECT_EQ(without.find("cxy_mm2"), std::string::npos);
  const auto number = [&](const char* column) {
    return std::stod(table.field(0, table.require(column).value()));
  };
  EXPECT_NEAR(number("cxy_mm2"), 0.01, 1e-12);
  EXPECT_NEAR(number("cxz_mm2"), -0.02, 1e-12);
  EXPECT_NEAR(number("cyz_mm2"), 0.03, 1e-12);
  EXPECT_NEAR(number("slx_mm"), 0.1, 1e-12);
  EXPECT_NEAR(number("slz_mm"), 0.3, 1e-12);
  EXPECT_EQ(predictions_json(list, with)["predictions"][0]["sly_mm"], 0.2);
}

TEST(Answers, OrientationsComeLastWhereAskedForAndHaveTheirKeysInJson) {
  JointList list;
  list.poses.push_back(CommandedPose{});
  exchange::Prediction item;
  item.rotation_stddev_deg = {1, 2, 3};
  const Predictions both{"abc", {item}, {}, true, true};
  const std::string text = predictions_csv(list, both);
  EXPECT_NE(text.find(",slz_mm,cxy_mm2,cxz_mm2,cyz_mm2,srx_deg,sry_deg,srz_deg\n"),
            std::string::npos)
      << text;
  EXPECT_TRUE(text.ends_with(",1,2,3\n")) << text;
  const auto json = predictions_json(list, both)["predictions"][0];
  EXPECT_EQ(json["sry_deg"], 2);
  EXPECT_EQ(json["in_domain"], false);
  EXPECT_EQ(json["nominal"]["qw"], 1);
  EXPECT_FALSE(predictions_json(list, {"abc", {item}})["predictions"][0].contains("sry_deg"));
}

TEST(Answers, WhatIsAskedHasMillimetresAndRadiansAndComesBack) {
  Target target;
  target.X_BT.translation() = Vector3(.001, -.002, 3);
  target.seed = Eigen::Vector2d(1, .25);
  const exchange::Rails rails = exchange::rails_of(kTypes);
  const exchange::AskedTarget asked = asked_of(target, rails);
  EXPECT_DOUBLE_EQ(asked.pose.xyz_mm[0], 1);
  EXPECT_DOUBLE_EQ(asked.pose.xyz_mm[1], -2);
  EXPECT_DOUBLE_EQ(asked.pose.xyz_mm[2], 3000);
  EXPECT_DOUBLE_EQ(asked.pose.q_wxyz[0], 1);
  EXPECT_EQ(asked.seed_rad, (std::vector<double>{1, 250}));
  target.seed.reset();
  target.conf = 2;
  EXPECT_TRUE(asked_of(target, rails).seed_rad.empty());
  EXPECT_EQ(asked_of(target, rails).conf, 2);
}

}  // namespace
}  // namespace trammel::cli
