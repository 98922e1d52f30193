#include <gtest/gtest.h>

#include <numbers>

#include "server/bias/bias_model.h"
#include "server/bias/kernels/joint_map_block.h"
#include "tests/bias/coupled_arm.h"
#include "tests/support/demand.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double kNoise = 10e-6;  // m

/// Gear errors of the three joints and a little of what they do not explain; whole turns.
BiasProblem gear_problem(Index count, std::uint64_t seed) {
  BiasProblem problem{random_joints(count, seed, 3) * (std::numbers::pi / 1.2), MatrixXd(count, 3),
                      Eigen::VectorXd::Constant(count, kNoise)};
  std::mt19937_64 random(seed + 500);
  for (Index i = 0; i < count; ++i) {
    const JointVector q = problem.q.row(i);
    problem.features.push_back(arm_features(q));
    const Vector3 error_B = problem.features.back().by_joint.topRows(3) * gear_errors(q) +
                            3e-5 * Vector3(std::sin(q[1]), std::cos(q[0] + q[1]), std::sin(q[2]));
    for (Index d = 0; d < 3; ++d) problem.residual_B(i, d) = error_B[d] + kNoise * normal(&random);
  }
  return problem;
}

BiasProblem part_of(const BiasProblem& problem, Index first, Index count) {
  return {problem.q.middleRows(first, count),
          problem.residual_B.middleRows(first, count),
          problem.sigma.segment(first, count),
          {problem.features.begin() + first, problem.features.begin() + first + count}};
}

BiasOptions spelled(const std::string& kernel) {
  BiasOptions options;
  options.kernel = kernel;
  options.starts = 2;
  return options;
}

BiasModel fit(const BiasProblem& problem, const std::string& kernel) {
  auto model = BiasModel::fit(problem, spelled(kernel));
  if (!model) throw std::runtime_error(model.error().message);
  return *std::move(model);
}

void expect_same_coupled_predictions(const BiasModel& a, const BiasModel& b) {
  const BiasProblem targets = gear_problem(70, 99);
  const auto from_a = a.predict_all(targets.q, targets.features);
  const auto from_b = b.predict_all(targets.q, targets.features);
  for (std::size_t i = 0; i < from_a.size(); ++i) {
    EXPECT_EQ(from_a[i].mean_B, from_b[i].mean_B);
    EXPECT_EQ(from_a[i].covariance_B, from_b[i].covariance_B);
    EXPECT_EQ(from_a[i].measured_stddev_B, from_b[i].measured_stddev_B);
    EXPECT_EQ(from_a[i].prior_share, from_b[i].prior_share);
  }
}

/// Fitted once for the tests that only look.
const BiasModel& fitted() {
  static const BiasModel model = fit(gear_problem(150, 1), "se + joint_map + parameters");
  return model;
}

TEST(CoupledModel, LearnsTheJointsErrorsThatAPlainKernelCannotAndItsIntervalsCover) {
  const BiasModel plain = fit(gear_problem(150, 1), "se");
  const BiasProblem fresh = gear_problem(400, 2);
  const auto predictions = fitted().predict_all(fresh.q, fresh.features);
  const MatrixXd left = fresh.residual_B - fitted().mean_all_B(fresh.q, fresh.features);
  const MatrixXd left_by_plain = fresh.residual_B - plain.mean_all_B(fresh.q);
  EXPECT_LT(left.norm(), 0.5 * left_by_plain.norm());
  int inside = 0;
  for (Index i = 0; i < 400; ++i) {
    const auto& at = predictions[static_cast<std::size_t>(i)];
    for (Index d = 0; d < 3; ++d) inside += std::abs(left(i, d)) < 1.96 * at.measured_stddev_B[d];
    EXPECT_EQ(at.stddev_B, Vector3(at.covariance_B.diagonal().cwiseSqrt()));
    EXPECT_EQ(at.covariance_B, Matrix3(at.covariance_B.transpose()));
  }
  EXPECT_NEAR(inside / 1200.0, 0.95, 0.03);
  EXPECT_GT(std::abs(predictions[0].covariance_B(0, 1)),
            1e-3 * predictions[0].covariance_B.trace());
}

TEST(CoupledModel, ManyTargetsSayWhatOneSays) {
  const BiasProblem targets = gear_problem(70, 3);
  const auto many = fitted().predict_all(targets.q, targets.features);
  for (const std::size_t i : {0u, 63u, 64u, 69u}) {
    const JointVector q = targets.q.row(static_cast<Index>(i));
    const BiasPrediction one = fitted().predict(q, targets.features[i]);
    EXPECT_LT((one.mean_B - many[i].mean_B).norm(), 1e-14);
    EXPECT_LT((one.covariance_B - many[i].covariance_B).norm(), 1e-10 * one.covariance_B.norm());
    EXPECT_EQ(one.mean_B, fitted().mean_B(q, targets.features[i]));
  }
}

TEST(CoupledModel, WhatRestsOnPosesNearbyIsTheSameWhoeverAsksAndEndsFarFromThem) {
  const BiasProblem targets = gear_problem(20, 5);
  const MatrixXd alone_B = fitted().nearby_mean_all_B(targets.q);
  for (Index i = 0; i < 20; ++i) {
    const BiasPrediction at =
        fitted().predict(targets.q.row(i), targets.features[static_cast<std::size_t>(i)]);
    EXPECT_LT((at.nearby_B - alone_B.row(i).transpose()).norm(), 1e-14);
    EXPECT_GT(at.nearby_B.norm(), 1e-6);
  }
  const JointVector far = JointVector::Constant(3, 100);
  const BiasPrediction at = fitted().predict(far, arm_features(far));
  EXPECT_LT(at.nearby_B.norm(), 1e-14);
  EXPECT_GT(at.mean_B.norm(), 1e-5);
}

TEST(CoupledModel, RestoresBitForBit) {
  const auto restored = BiasModel::restore(fitted().state());
  ASSERT_TRUE(restored.has_value()) << restored.error().message;
  expect_same_coupled_predictions(fitted(), *restored);
  EXPECT_EQ(fitted().leave_one_out_mean_B(), restored->leave_one_out_mean_B());
  EXPECT_EQ(fitted().report().noise_stddev, restored->report().noise_stddev);
}

TEST(CoupledModel, LeaveOneOutEqualsRestoringWithoutThePose) {
  const auto rest = fitted().without({40});
  ASSERT_TRUE(rest.has_value()) << rest.error().message;
  const BiasState& all = fitted().state();
  const BiasPrediction expected = rest->predict(all.q.row(40).transpose(), all.features[40]);
  EXPECT_LT((fitted().leave_one_out_mean_B().row(40).transpose() - expected.mean_B).norm(),
            1e-6 * kNoise);
  // One factor widens all stddevs, learned from 150 poses here and from 149 there.
  const Vector3 ratio = fitted().leave_one_out_stddev_B().row(40).transpose().cwiseQuotient(
      expected.measured_stddev_B);
  EXPECT_NEAR(ratio[0], 1, 0.02);
  EXPECT_NEAR(ratio[1], ratio[0], 1e-4);
  EXPECT_NEAR(ratio[2], ratio[0], 1e-4);
  EXPECT_NEAR(fitted().leave_one_out_prior_share()[40], expected.prior_share, 1e-3);
}

TEST(CoupledModel, GrowsAsIfConditionedAnewAndRefitsFromWhereItWas) {
  const BiasProblem all = gear_problem(150, 1);
  const BiasModel few = fit(part_of(all, 0, 120), "se + joint_map");
  const auto grown = few.with(part_of(all, 120, 30));
  ASSERT_TRUE(grown.has_value()) << grown.error().message;
  expect_same_coupled_predictions(*grown, *BiasModel::restore(grown->state()));
  const auto refitted = grown->refit({});
  ASSERT_TRUE(refitted.has_value()) << refitted.error().message;
  EXPECT_LE(refitted->report().evaluations, 15);
  EXPECT_GE(refitted->report().log_likelihood.sum(), grown->report().log_likelihood.sum() - 0.1);
}

// Hyperparameters of a joint were two: amplitude and knee.
TEST(CoupledModel,
     AStateFromBeforeThePowerWasLearnedPredictsAsOneWithPowerTwoAndFortyEightHarmonics) {
  const Index joints = fitted().state().features.front().by_joint.cols();
  const BiasState state = fitted().state();
  ASSERT_EQ(state.block_hyperparameters.size(), 3 * joints + 1);
  BiasState before = state, now = state;
  before.block_hyperparameters.resize(2 * joints);
  for (Index j = 0; j < joints; ++j) {
    before.block_hyperparameters.segment<2>(2 * j) = state.block_hyperparameters.segment<2>(3 * j);
    now.block_hyperparameters[3 * j + 2] = std::log(2.0);
  }
  now.block_hyperparameters[3 * joints] = std::log(48.0);
  const BiasModel of_before = test::demand(BiasModel::restore(before));
  const BiasModel of_now = test::demand(BiasModel::restore(now));
  const BiasProblem targets = gear_problem(40, 98);
  const auto said_before = of_before.predict_all(targets.q, targets.features);
  const auto said_now = of_now.predict_all(targets.q, targets.features);
  for (std::size_t i = 0; i < said_before.size(); ++i) {
    EXPECT_LT((said_before[i].mean_B - said_now[i].mean_B).norm(), 1e-12);
    EXPECT_LT((said_before[i].stddev_B - said_now[i].stddev_B).norm(), 1e-12);
  }
  EXPECT_EQ(of_before.refit({})->state().block_hyperparameters.size(), 2 * joints)
      << "it stays what it is";
  now.block_hyperparameters[3 * joints] = std::log(1e6);
  EXPECT_FALSE(BiasModel::restore(now)) << "nobody has a million harmonics";
}

TEST(CoupledModel, MoreObservationsTellMoreHarmonics) {
  EXPECT_EQ(harmonics_for(100), 48);
  EXPECT_EQ(harmonics_for(1200), 75);
  EXPECT_EQ(harmonics_for(4000), 112);
  const Index last = fitted().state().block_hyperparameters.size() - 1;
  EXPECT_DOUBLE_EQ(fitted().state().block_hyperparameters[last], std::log(48.0))
      << "no search moves it";
}

TEST(CoupledModel, RefusesWhatItCannotLearnFrom) {
  const auto refusal = [](const BiasProblem& problem, const std::string& kernel) {
    const auto model = BiasModel::fit(problem, spelled(kernel));
    return refusal_of(model);
  };
  BiasProblem problem = gear_problem(20, 5);
  problem.features.pop_back();
  EXPECT_EQ(refusal(problem, "se + joint_map"),
            Refusal("bias data", {}, "features").beyond(19, 20));
  problem = gear_problem(20, 5);
  problem.features[7].by_parameter.resize(6, 1);
  EXPECT_EQ(refusal(problem, "se + parameters"), Refusal("bias data", 8, "features"));
  problem = gear_problem(20, 5);
  problem.features[7].by_joint(2, 2) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal(problem, "se + parameters"), Refusal("bias data", 8, "features"));
  EXPECT_EQ(refusal(gear_problem(4001, 5), "se + joint_map"),
            Refusal("", {}, "bias").beyond(4001, 4000).text("se + joint_map"));
  EXPECT_EQ(refusal(gear_problem(20, 5), "se * joint_map"),
            Refusal("", {}, "bias").text("se * joint_map"));

  BiasState state = fitted().state();
  state.block_hyperparameters.conservativeResize(4);
  EXPECT_EQ(refusal_of(BiasModel::restore(state)),
            Refusal("", {}, "block_hyperparameters").beyond(4, 6));
}

TEST(CoupledModel, StopsWhenTold) {
  BiasOptions options = spelled("se + joint_map");
  options.progress = [](double share) { return share < 0.2; };
  const auto model = BiasModel::fit(gear_problem(60, 6), options);
  ASSERT_FALSE(model.has_value());
  EXPECT_EQ(refusal_of(model), Refusal().of(ErrorCode::kBusy));
  EXPECT_EQ(model.error().code, ErrorCode::kBusy);
}

}  // namespace
}  // namespace trammel
