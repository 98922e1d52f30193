#include "server/bias/search/hyperparameter_search.h"

#include <gtest/gtest.h>

#include "server/calibrate/calibrate.h"
#include "tests/bias/bias_data.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using Eigen::Index;

/// The residuals of the virtual robot beyond geometry: its compliance, in all joints' full
/// ranges.
GpData sag_of_the_virtual_robot(int poses) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const MeasurementBatch batch = test::measured(robot, poses, 5);
  const PhysicalModel model = test::demand(calibrate(cell, {"base", "geometry"}, batch, {})).model;
  const Index n = poses;
  GpData data{Eigen::MatrixXd(n, 6), Eigen::MatrixXd(n, 3), Eigen::VectorXd::Ones(n)};
  for (Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    data.q.row(i) = m.context.q.transpose();
    data.y.row(i) = (m.p_W - model.pose_W(m.context).translation()).transpose();
  }
  data.y.rowwise() -= data.y.colwise().mean().eval();
  return data;
}

// 300 poses cannot tell the fine influence of joint 4 on the height from 0.7 mm of noise; 700 can,
// by 90 nats.
TEST(HyperparameterSearch, FindsAFineInfluenceThatFewPosesTakeForNoise) {
  const GpData data = sag_of_the_virtual_robot(700);
  for (const std::uint64_t seed : {1, 2}) {
    SearchOptions options;
    options.seed = seed;
    const auto found = search_hyperparameters(make_kernel("se"), data, 13e-6, options);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(std::exp(found->outputs[2].log_noise_stddev), 300e-6) << "seed " << seed;
    EXPECT_LT(std::exp(found->outputs[2].kernel[3]), 4.0) << "rad, seed " << seed;
  }
}

// 0.3 mm that repeats within half a rad of two joints: fewer points than all cannot tell it from
// noise.
GpData fine_function_of_two_joints(int poses) {
  const Index n = poses;
  GpData data{random_joints(n, 3, 3), Eigen::MatrixXd(n, 1), Eigen::VectorXd::Ones(n)};
  std::mt19937_64 random(4);
  for (Index i = 0; i < n; ++i) {
    const double fine = std::sin(12 * data.q(i, 1)) * std::cos(12 * data.q(i, 2));
    data.y(i, 0) = 0.3e-3 * std::sin(1.2 * data.q(i, 0)) + 0.2e-3 * fine + 13e-6 * normal(&random);
  }
  data.y.array() -= data.y.mean();
  return data;
}

TEST(HyperparameterSearch, LooksAroundOnAllPosesWhereMuchNoiseIsLeft) {
  const GpData data = fine_function_of_two_joints(1200);
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    SearchOptions options;
    options.seed = seed;
    double last = 0;
    options.progress = [&last](double share) {
      EXPECT_GE(share, last);
      EXPECT_LE(share, 1.0);
      last = share;
      return true;
    };
    const auto found = search_hyperparameters(make_kernel("se"), data, 13e-6, options);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(std::exp(found->outputs[0].log_noise_stddev), 15e-6) << "seed " << seed;
    EXPECT_EQ(last, 1.0);
  }
}

TEST(HyperparameterSearch, GivesUpWhileItLooksAround) {
  SearchOptions options;
  options.progress = [](double share) { return share < 0.7; };
  const auto found =
      search_hyperparameters(make_kernel("se"), fine_function_of_two_joints(1100), 13e-6, options);
  ASSERT_TRUE(found.has_value());
  EXPECT_TRUE(found->given_up);
}

TEST(HyperparameterSearch, TriesNothingMoreWhereTheNoiseIsMetrologys) {
  const BiasProblem problem = smooth_problem(1100, 1);
  const GpData data{problem.q, problem.residual_B, Eigen::VectorXd::Ones(1100)};
  EXPECT_LT(search_hyperparameters(make_kernel("se"), data, 10e-6, {})->evaluations, 40);
  EXPECT_GT(search_hyperparameters(make_kernel("se"), data, 1e-6, {})->evaluations, 40);
}

}  // namespace
}  // namespace trammel
