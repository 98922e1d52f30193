#include "server/measurement/files/references.h"

#include <gtest/gtest.h>

#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

PointList reflectors(const std::string& where = "refs.csv") {
  PointList list{where, {}};
  const std::vector<Vector3> points = {
      {0, 0, 0}, {3, 0, 0.2}, {3, 2, 0.1}, {0, 2, 0.9}, {1.5, 1, 2}};
  for (std::size_t i = 0; i < points.size(); ++i) {
    NamedPoint point;
    point.name = fmt::format("R{}", i + 1);
    point.p_W = points[i];
    point.row = static_cast<int>(i) + 2;
    list.points.push_back(point);
  }
  return list;
}

PointList moved(const Pose& X) {
  PointList list = reflectors("now.csv");
  for (NamedPoint& point : list.points) point.p_W = X * point.p_W;
  return list;
}

Pose shifted(double x) { return make_pose(Matrix3::Identity(), {x, 0, 0}); }

Refusal refusal(const PointList& references, const PointList& measured,
                const ReferenceOptions& options = {}) {
  const auto check = check_references(references, measured, options);
  return refusal_of(check);
}

TEST(References, FindWhereTheTrackerHasMovedTo) {
  const Pose X_WV = make_pose(rotation_exp({0.01, -0.3, 2}), {1, -2, 0.5});
  const auto check = check_references(reflectors(), moved(X_WV.inverse()));
  ASSERT_TRUE(check) << check.error().message;
  EXPECT_LT(pose_difference(check->X_WV, X_WV).norm(), 1e-12);
  EXPECT_LT(check->rms_remaining, 1e-12);
  EXPECT_TRUE(check->rigid);
  EXPECT_EQ(check->verdict, ReferenceVerdict::kLocaliseAndRepeat);
}

TEST(References, AreJudgedByTheRmsAtBothThresholds) {
  const auto verdict = [](double shift) {
    return check_references(reflectors(), moved(shifted(shift)))->verdict;
  };
  EXPECT_EQ(verdict(0), ReferenceVerdict::kFine);
  EXPECT_EQ(verdict(19.9e-6), ReferenceVerdict::kFine);
  EXPECT_EQ(verdict(20.1e-6), ReferenceVerdict::kLocalise);
  EXPECT_EQ(verdict(99.9e-6), ReferenceVerdict::kLocalise);
  EXPECT_EQ(verdict(100.1e-6), ReferenceVerdict::kLocaliseAndRepeat);
  const auto strict = check_references(reflectors(), moved(shifted(6e-6)), {5e-6, 10e-6});
  ASSERT_TRUE(strict) << strict.error().message;
  EXPECT_EQ(strict->verdict, ReferenceVerdict::kLocalise);
  EXPECT_NEAR(strict->rms, 6e-6, 1e-12);
}

TEST(References, NameTheReflectorThatMovedByItself) {
  PointList now = moved(shifted(1e-3));
  now.points[3].p_W += Vector3(0, 5e-3, 0);
  const auto check = check_references(reflectors(), now);
  ASSERT_TRUE(check) << check.error().message;
  EXPECT_EQ(check->worst, "R4");
  EXPECT_FALSE(check->rigid);
  ASSERT_EQ(check->residuals.size(), 5u);
  EXPECT_LT((check->residuals[3].difference_W - Vector3(1e-3, 5e-3, 0)).norm(), 1e-12);
  double sum = 0;
  for (const ReferenceResidual& residual : check->residuals)
    sum += residual.remaining_W.squaredNorm();
  EXPECT_NEAR(check->rms_remaining, std::sqrt(sum / 5), 1e-15);
}

TEST(References, AreMatchedByNameAndMayMissSome) {
  const Pose X = make_pose(rotation_exp({0, 0, 1}), {1, 0, 0});
  PointList now = moved(X);
  std::swap(now.points[0], now.points[4]);
  now.points.erase(now.points.begin() + 1);
  const auto check = check_references(reflectors(), now);
  ASSERT_TRUE(check) << check.error().message;
  EXPECT_LT(pose_difference(check->X_WV, X.inverse()).norm(), 1e-12);
  EXPECT_EQ(check->not_measured, std::vector<std::string>{"R2"});
  EXPECT_EQ(check->residuals.size(), 4u);
}

TEST(References, RefuseTooFewUnknownOnesOnALineAndLimitsThatMakeNoSense) {
  PointList two = moved(shifted(0));
  two.points.resize(2);
  EXPECT_EQ(refusal(reflectors(), two), Refusal("now.csv").beyond(2, 3));
  PointList unknown = moved(shifted(0));
  unknown.points[2].name = "R9";
  EXPECT_EQ(refusal(reflectors(), unknown), Refusal("now.csv", 4, "name").text("R9"));
  PointList line = reflectors();
  for (std::size_t i = 0; i < 5; ++i)
    line.points[i].p_W = static_cast<double>(i) * Vector3(1, 2, 3);
  PointList line_now = line;
  line_now.where = "now.csv";
  EXPECT_EQ(refusal(line, line_now), Refusal("now.csv"));
  EXPECT_EQ(refusal(reflectors(), moved(shifted(0)), {50e-6, 20e-6}),
            Refusal("").beyond(0.05, 0.02));
}

TEST(References, BringABatchIntoTheirFrame) {
  const auto batch = parse_batch_csv(
      "q1_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz\n1,1000,0,0,1,0,0,0\n2,0,1000,0,,,,\n", "b.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  const Pose X_WV = make_pose(rotation_exp({0, 0, std::acos(0.0)}), {0, 0, 1});
  const MeasurementBatch there = localised(*batch, X_WV);
  EXPECT_LT((there.measurements[0].p_W - Vector3(0, 1, 1)).norm(), 1e-12);
  EXPECT_LT((there.measurements[0].R_WT.value_or(Matrix3::Zero()) - X_WV.linear()).norm(), 1e-12);
  EXPECT_FALSE(there.measurements[1].R_WT);
  EXPECT_EQ(there.source_text, to_csv(there));
}

}  // namespace
}  // namespace trammel
