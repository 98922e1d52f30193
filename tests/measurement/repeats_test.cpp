#include "server/measurement/repeats.h"

#include <gtest/gtest.h>

#include <random>

namespace trammel {
namespace {

constexpr double kTracker = 13e-6;  // m

Measurement measured(const JointVector& q, const Vector3& p) {
  Measurement m;
  m.context.q = q;
  m.p_W = p;
  return m;
}

JointVector joints(double first) { return JointVector::LinSpaced(6, first, first + 1); }

MeasurementBatch batch_of(std::vector<Measurement> measurements) {
  MeasurementBatch batch;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    measurements[i].pose_id = fmt::format("{}", i);
    measurements[i].context.index = static_cast<int>(i);
  }
  batch.measurements = std::move(measurements);
  return batch;
}

/// `poses` poses, each measured `times` times with this sigma on each axis, one round after the
/// other.
MeasurementBatch noisy(int poses, int times, double sigma, double sigma_rotation) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const auto noise = [&](double s) {
    return Vector3(s * normal(random), s * normal(random), s * normal(random));
  };
  std::vector<Measurement> measurements;
  for (int round = 0; round < times; ++round) {
    for (int pose = 0; pose < poses; ++pose) {
      measurements.push_back(
          measured(joints(0.1 * pose), Vector3(1, 0.1 * pose, 2) + noise(sigma)));
      measurements.back().R_WT =
          rotation_exp(noise(sigma_rotation)) * rotation_exp({0.1 * pose, 0, 3});
    }
  }
  return batch_of(std::move(measurements));
}

TEST(Repeats, AreAveragedByTheirWeights) {
  std::vector<Measurement> rows = {measured(joints(0), {1, 0, 0}), measured(joints(1), {5, 0, 0}),
                                   measured(joints(0), {1 + 50e-6, 0, 0})};
  rows[0].sigma = 10e-6;
  rows[2].sigma = 20e-6;
  const MergedRepeats merged = merge_repeats(batch_of(rows), kTracker);
  ASSERT_EQ(merged.batch.measurements.size(), 2u);
  const Measurement& mean = merged.batch.measurements[0];
  EXPECT_EQ(mean.pose_id, "0");
  EXPECT_NEAR(mean.p_W.x(), 1 + 10e-6, 1e-12);
  EXPECT_NEAR(mean.sigma.value_or(0), 10e-6 / std::sqrt(1.25), 1e-12);
  EXPECT_EQ(merged.batch.measurements[1].pose_id, "1");
  EXPECT_NEAR(merged.batch.measurements[1].sigma.value_or(0), kTracker, 1e-15);
  EXPECT_EQ(merged.statistics.groups, 1);
  EXPECT_EQ(merged.statistics.measurements, 2);
  EXPECT_EQ(merged.statistics.degrees_of_freedom, 3);
  EXPECT_NEAR(merged.statistics.sigma, 50e-6 / std::sqrt(2.0) / std::sqrt(3.0), 1e-12);
  EXPECT_EQ(merged.statistics.sigma_factor, 1);
}

TEST(Repeats, PoolTheSigmaOfOneMeasurementOverPoses) {
  const double sigma = 50e-6;
  const MergedRepeats merged = merge_repeats(noisy(200, 4, sigma, 80e-6), kTracker);
  ASSERT_EQ(merged.batch.measurements.size(), 200u);
  EXPECT_EQ(merged.statistics.groups, 200);
  EXPECT_EQ(merged.statistics.degrees_of_freedom, 1800);
  EXPECT_EQ(merged.statistics.rotation_degrees_of_freedom, 1800);
  EXPECT_NEAR(merged.statistics.sigma, sigma, 0.06 * sigma);
  EXPECT_NEAR(merged.statistics.sigma_rotation, 80e-6, 0.06 * 80e-6);
  EXPECT_NEAR(merged.statistics.sigma_factor, sigma / kTracker, 0.06 * sigma / kTracker);
}

TEST(Repeats, GiveEveryRowTheScatterThatTheyShow) {
  const double sigma = 50e-6;
  MeasurementBatch batch = noisy(200, 4, sigma, 80e-6);
  batch.measurements.push_back(measured(joints(-2), {0, 0, 0}));
  const MergedRepeats merged = merge_repeats(batch, kTracker);
  EXPECT_NEAR(merged.batch.measurements.front().sigma.value_or(0), sigma / 2, 0.06 * sigma / 2);
  EXPECT_NEAR(merged.batch.measurements.back().sigma.value_or(0), sigma, 0.06 * sigma);
  double squares = 0;
  for (int i = 0; i < 200; ++i) {
    squares += (merged.batch.measurements[static_cast<std::size_t>(i)].p_W - Vector3(1, 0.1 * i, 2))
                   .squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(squares / 600), sigma / 2, 0.1 * sigma / 2);
}

TEST(Repeats, LeaveStatedSigmasAloneWhereTheScatterIsNotLarger) {
  const MergedRepeats merged = merge_repeats(noisy(50, 3, 5e-6, 5e-6), kTracker);
  EXPECT_EQ(merged.statistics.sigma_factor, 1);
  EXPECT_NEAR(merged.batch.measurements[0].sigma.value_or(0), kTracker / std::sqrt(3.0), 1e-12);
}

TEST(Repeats, AverageOrientationsAlsoFarFromTheIdentity) {
  std::vector<Measurement> rows(2, measured(joints(0), {1, 0, 0}));
  const Matrix3 R = rotation_exp({0, 3.1, 0});
  rows[0].R_WT = rotation_exp({0, 0.2, 0}) * R;
  rows[1].R_WT = rotation_exp({0, -0.2, 0}) * R;
  const MergedRepeats merged = merge_repeats(batch_of(rows), kTracker);
  ASSERT_EQ(merged.batch.measurements.size(), 1u);
  EXPECT_LT((merged.batch.measurements[0].R_WT.value_or(Matrix3::Zero()) - R).norm(), 1e-12);
  EXPECT_NEAR(merged.statistics.sigma_rotation, 0.2 * std::sqrt(2.0 / 3), 1e-9);
}

TEST(Repeats, KeepTheMeansOfTimeAndTemperatureThatWereRecorded) {
  std::vector<Measurement> rows(3, measured(joints(0), {1, 0, 0}));
  rows[0].context.time = 10;
  rows[1].context.time = 40;
  rows[0].context.temperature = 20;
  rows[1].context.temperature = 21;
  rows[2].context.temperature = 25;
  const MergedRepeats merged = merge_repeats(batch_of(rows), kTracker);
  ASSERT_EQ(merged.batch.measurements.size(), 1u);
  EXPECT_EQ(merged.batch.measurements[0].context.time, 25);
  EXPECT_EQ(merged.batch.measurements[0].context.temperature, 22);
}

TEST(Repeats, HaveTheSameJointsToolPayloadDirectionAndSetAndStandStill) {
  const Measurement first = measured(joints(0), {1, 0, 0});
  const auto left = [&](auto change) {
    std::vector<Measurement> rows(2, first);
    change(rows[1]);
    return merge_repeats(batch_of(rows), kTracker).batch.measurements.size();
  };
  EXPECT_EQ(left([](Measurement& m) { m.context.q(5) += 0.9e-6; }), 1u);
  EXPECT_EQ(left([](Measurement& m) { m.context.q(5) += 1.1e-6; }), 2u);
  EXPECT_EQ(left([](Measurement& m) { m.context.q(0) += 1e-3, m.context.q(1) -= 1e-3; }), 2u);
  EXPECT_EQ(left([](Measurement& m) { m.context.tool = "other"; }), 2u);
  EXPECT_EQ(left([](Measurement& m) { m.context.payload = "other"; }), 2u);
  EXPECT_EQ(left([](Measurement& m) { m.context.direction = {1, 0, 0, 0, 0, 0}; }), 2u);
  EXPECT_EQ(left([](Measurement& m) { m.set = MeasurementSet::kValidation; }), 2u);
  EXPECT_EQ(left([](Measurement& m) { m.context.velocity = JointVector::Zero(6); }), 2u);
}

TEST(Repeats, ABatchWithoutAnyStaysAsItIs) {
  const MeasurementBatch batch = noisy(5, 1, 1e-5, 1e-5);
  const MergedRepeats merged = merge_repeats(batch, kTracker);
  EXPECT_EQ(to_csv(merged.batch), to_csv(batch));
  EXPECT_EQ(merged.statistics.groups, 0);
  EXPECT_EQ(merged.statistics.degrees_of_freedom, 0);
}

}  // namespace
}  // namespace trammel
