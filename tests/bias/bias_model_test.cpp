#include "server/bias/bias_model.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/bias/bias_data.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

using Eigen::Index;

BiasModel fit(const BiasProblem& problem, const BiasOptions& options = {}) {
  auto model = BiasModel::fit(problem, options);
  if (!model) throw std::runtime_error(model.error().message);
  return *std::move(model);
}

BiasProblem without(const BiasProblem& problem, Index row) {
  const Index last = problem.q.rows() - 1;
  BiasProblem rest{problem.q.topRows(last), problem.residual_B.topRows(last),
                   problem.sigma.head(last)};
  for (Index i = row; i < last; ++i) {
    rest.q.row(i) = problem.q.row(i + 1);
    rest.residual_B.row(i) = problem.residual_B.row(i + 1);
    rest.sigma[i] = problem.sigma[i + 1];
  }
  return rest;
}

void expect_same_predictions(const BiasModel& a, const BiasModel& b) {
  const Eigen::MatrixXd q = random_joints(50, 99);
  const auto from_a = a.predict_all(q);
  const auto from_b = b.predict_all(q);
  for (std::size_t i = 0; i < from_a.size(); ++i) {
    EXPECT_EQ(from_a[i].mean_B, from_b[i].mean_B);
    EXPECT_EQ(from_a[i].stddev_B, from_b[i].stddev_B);
    EXPECT_EQ(from_a[i].measured_stddev_B, from_b[i].measured_stddev_B);
    EXPECT_EQ(from_a[i].prior_share, from_b[i].prior_share);
  }
}

TEST(BiasModel, LearnsASmoothFunctionToTheNoise) {
  const BiasModel model = fit(smooth_problem(400, 1));
  const Eigen::MatrixXd q = random_joints(300, 2);
  double total = 0;
  for (Index i = 0; i < q.rows(); ++i)
    total += (model.mean_B(q.row(i)) - smooth_error_B(q.row(i))).squaredNorm();
  EXPECT_LT(std::sqrt(total / 300), 12e-6)
      << "m, of errors of some 0.2 mm, learned with 10 µm of noise per axis";
  EXPECT_LT(model.report().leave_one_out_rms, 1.25 * std::sqrt(3.0) * 10e-6);
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(model.report().noise_stddev[d], 10e-6, 2e-6);
  EXPECT_GE(model.report().starts_at_best, 1);
  EXPECT_GE(model.report().evaluations, 1);
}

TEST(BiasModel, LearnsWithMaternKernelsToo) {
  for (const char* kernel : {"matern32", "matern52"}) {
    BiasOptions options;
    options.kernel = kernel;
    options.starts = 5;
    const BiasModel model = fit(smooth_problem(300, 1), options);
    EXPECT_LT(model.report().leave_one_out_rms, 60e-6) << kernel;
  }
}

TEST(BiasModel, SaysTheMeanResidualFarFromAllData) {
  BiasProblem problem = smooth_problem(100, 3);
  problem.residual_B.col(0).array() += 0.002;
  const BiasModel model = fit(problem);
  const BiasPrediction far = model.predict(JointVector::Constant(6, 1000.0));
  EXPECT_NEAR(far.mean_B[0], problem.residual_B.col(0).mean(), 1e-9);
  EXPECT_NEAR(far.prior_share, 1.0, 1e-9);
}

TEST(BiasModel, KnowsLessAwayFromTheData) {
  const BiasModel model = fit(smooth_problem(200, 4));
  JointVector q = JointVector::Zero(6);
  BiasPrediction before = model.predict(q);
  for (const double angle : {1.5, 3.0, 6.0}) {
    q.setConstant(angle);
    const BiasPrediction away = model.predict(q);
    EXPECT_GT(away.prior_share, before.prior_share);
    for (int d = 0; d < 3; ++d) EXPECT_GT(away.stddev_B[d], before.stddev_B[d]);
    before = away;
  }
}

TEST(BiasModel, IntervalsCoverFreshMeasurementsAsOftenAsTheySay) {
  const BiasModel model = fit(smooth_problem(500, 5));
  const BiasProblem fresh = smooth_problem(1500, 6);
  const auto predictions = model.predict_all(fresh.q);
  int inside = 0;
  for (Index i = 0; i < fresh.q.rows(); ++i) {
    const BiasPrediction& prediction = predictions[static_cast<std::size_t>(i)];
    for (int d = 0; d < 3; ++d)
      inside += std::abs(fresh.residual_B(i, d) - prediction.mean_B[d]) <
                1.96 * prediction.measured_stddev_B[d];
  }
  EXPECT_NEAR(inside / 4500.0, 0.95, 0.02);
}

TEST(BiasModel, LeaveOneOutEqualsRefittingWithoutThePoint) {
  const BiasProblem problem = smooth_problem(60, 7, 30e-6);
  const BiasModel model = fit(problem);
  const Eigen::MatrixXd left_out = model.leave_one_out_mean_B();
  const Eigen::MatrixXd stddev = model.leave_one_out_stddev_B();
  const Eigen::VectorXd share = model.leave_one_out_prior_share();
  for (Index i = 0; i < problem.q.rows(); i += 7) {
    BiasState state = model.state();
    const BiasProblem rest = without(problem, i);
    state.q = rest.q;
    state.residual_B = rest.residual_B;
    state.sigma = rest.sigma;
    const auto other = BiasModel::restore(state);
    ASSERT_TRUE(other.has_value());
    const BiasPrediction prediction = other->predict(problem.q.row(i));
    EXPECT_LT((left_out.row(i).transpose() - prediction.mean_B).norm(), 1e-11);
    EXPECT_LT((stddev.row(i).transpose() - prediction.measured_stddev_B).norm(), 1e-11);
    EXPECT_NEAR(share[i], prediction.prior_share, 1e-8);
  }
}

/// `poses` joint vectors of `smooth`, each measured by three reflectors that share an error of the
/// arm of 5 sigma.
BiasProblem three_reflectors(Index poses, std::uint64_t seed, double smooth) {
  BiasProblem problem = smooth_problem(3 * poses, seed, 30e-6);
  std::mt19937_64 random(seed + 500);
  for (Index i = 0; i < 3 * poses; ++i) {
    const Index first = i - i % 3;
    problem.q.row(i) = problem.q.row(first);
    for (Index d = 0; d < 3; ++d) {
      const double shared = i == first ? 5 * problem.sigma[0] * normal(&random) : 0.0;
      problem.residual_B(i, d) = i == first ? shared : problem.residual_B(first, d);
    }
  }
  for (Index i = 0; i < 3 * poses; ++i) {
    problem.residual_B.row(i) += smooth * smooth_error_B(problem.q.row(i)).transpose();
    for (Index d = 0; d < 3; ++d) problem.residual_B(i, d) += problem.sigma[0] * normal(&random);
  }
  return problem;
}

TEST(BiasModel, LeavesAllReflectorsOfAPoseOutTogether) {
  const BiasProblem problem = three_reflectors(20, 8, 1.0);
  const BiasModel model = fit(problem);
  const Eigen::MatrixXd left_out = model.leave_one_out_mean_B();
  const Eigen::MatrixXd stddev = model.leave_one_out_stddev_B();
  const Eigen::VectorXd share = model.leave_one_out_prior_share();
  for (Index i = 0; i < problem.q.rows(); i += 9) {
    BiasState state = model.state();
    BiasProblem rest = problem;
    for (Index k = 0; k < 3; ++k) rest = without(rest, i);
    state.q = rest.q;
    state.residual_B = rest.residual_B;
    state.sigma = rest.sigma;
    const auto other = BiasModel::restore(state);
    ASSERT_TRUE(other.has_value());
    const BiasPrediction prediction = other->predict(problem.q.row(i));
    for (Index k = i; k < i + 3; ++k) {
      EXPECT_LT((left_out.row(k).transpose() - prediction.mean_B).norm(), 1e-9);
      EXPECT_LT((stddev.row(k).transpose() - prediction.measured_stddev_B).norm(), 1e-9);
      EXPECT_NEAR(share[k], prediction.prior_share, 1e-6);
    }
  }
}

TEST(BiasModel, GrowsAndShrinksAsIfConditionedAnew) {
  const BiasProblem all = smooth_problem(230, 30);
  const BiasModel model =
      fit({all.q.topRows(200), all.residual_B.topRows(200), all.sigma.head(200)});
  const auto grown =
      model.with({all.q.bottomRows(30), all.residual_B.bottomRows(30), all.sigma.tail(30)});
  ASSERT_TRUE(grown.has_value());
  const auto anew = BiasModel::restore(grown->state());
  ASSERT_TRUE(anew.has_value());
  std::vector<Index> fresh;
  for (Index i = 200; i < 230; ++i) fresh.push_back(i);
  const auto shrunk = grown->without(fresh);
  ASSERT_TRUE(shrunk.has_value());
  const Eigen::MatrixXd q = random_joints(20, 31);
  EXPECT_LT((grown->mean_all_B(q) - anew->mean_all_B(q)).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT((shrunk->mean_all_B(q) - model.mean_all_B(q)).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT((grown->leave_one_out_mean_B() - anew->leave_one_out_mean_B()).cwiseAbs().maxCoeff(),
            1e-13);
  EXPECT_GT((grown->mean_all_B(q) - model.mean_all_B(q)).cwiseAbs().maxCoeff(), 1e-7)
      << "the new poses teach something";
}

TEST(BiasModel, GrowsToRoundingWhereTheMedianSigmaMoves) {
  BiasProblem all = smooth_problem(90, 32);
  for (Index i = 0; i < 90; ++i) all.sigma[i] = 10e-6 * (1.0 + 0.01 * static_cast<double>(i));
  const BiasModel model = fit({all.q.topRows(80), all.residual_B.topRows(80), all.sigma.head(80)});
  const auto grown =
      model.with({all.q.bottomRows(10), all.residual_B.bottomRows(10), all.sigma.tail(10)});
  ASSERT_TRUE(grown.has_value());
  expect_same_predictions(*grown, *BiasModel::restore(grown->state()));
}

TEST(BiasModel, RefusesToGrowOrShrinkIntoWhatItCannotLearnFrom) {
  const BiasModel model = fit(smooth_problem(12, 33));
  EXPECT_EQ(refusal_of(model.without({0, 1, 2})), Refusal("bias data").beyond(9, 10));
  EXPECT_EQ(refusal_of(model.without({12})),
            Refusal("bias data", {}, "observation").beyond(12, 12));
  BiasProblem bad = smooth_problem(2, 34);
  bad.q(1, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal_of(model.with(bad)),
            Refusal("bias data", 14, "joint 1").value(std::numeric_limits<double>::quiet_NaN()));
}

TEST(BiasModel, RefitsFromWhereItWasInAFewEvaluations) {
  const BiasProblem all = smooth_problem(330, 35);
  const BiasModel model =
      fit({all.q.topRows(300), all.residual_B.topRows(300), all.sigma.head(300)});
  const auto grown =
      model.with({all.q.bottomRows(30), all.residual_B.bottomRows(30), all.sigma.tail(30)});
  ASSERT_TRUE(grown.has_value());
  const auto refitted = grown->refit({});
  ASSERT_TRUE(refitted.has_value());
  const BiasModel from_scratch = fit(all);
  EXPECT_NEAR(refitted->report().log_likelihood.sum(), from_scratch.report().log_likelihood.sum(),
              0.5)
      << "nat";
  EXPECT_LE(refitted->report().evaluations, 15) << "five an output";
}

TEST(BiasModel, RestoresBitForBit) {
  const BiasModel model = fit(smooth_problem(120, 8));
  const auto restored = BiasModel::restore(model.state());
  ASSERT_TRUE(restored.has_value());
  expect_same_predictions(model, *restored);
  EXPECT_EQ(model.leave_one_out_mean_B(), restored->leave_one_out_mean_B());
}

TEST(BiasModel, GivesTheSameModelForTheSameSeed) {
  const BiasModel model = fit(smooth_problem(320, 9));
  const BiasModel again = fit(smooth_problem(320, 9));
  EXPECT_EQ(model.state().hyperparameters, again.state().hyperparameters);
  expect_same_predictions(model, again);
}

TEST(BiasModel, PredictsOneAsItPredictsMany) {
  const BiasModel model = fit(smooth_problem(100, 10));
  const Eigen::MatrixXd q = random_joints(21, 11);
  const auto many = model.predict_all(q);
  for (Index i = 0; i < q.rows(); ++i) {
    const BiasPrediction one = model.predict(q.row(i));
    EXPECT_LT((one.mean_B - many[static_cast<std::size_t>(i)].mean_B).norm(), 1e-15);
    EXPECT_LT((one.stddev_B - many[static_cast<std::size_t>(i)].stddev_B).norm(), 1e-12);
    EXPECT_EQ(one.mean_B, model.mean_B(q.row(i)));
  }
}

TEST(BiasModel, KeepsTheNoiseNearMetrologyWhenTheDataHaveNone) {
  BiasProblem problem = smooth_problem(80, 12, 0.0);
  problem.sigma.setConstant(10e-6);
  const BiasModel model = fit(problem);
  for (int d = 0; d < 3; ++d) EXPECT_GT(model.report().noise_stddev[d], 0.1e-6);
}

TEST(BiasModel, TrustsAPointOfLargerSigmaLess) {
  BiasProblem problem = smooth_problem(100, 13);
  problem.sigma.head(20).setConstant(30e-6);
  const BiasModel model = fit(problem);
  const BiasPrediction vague = model.predict(problem.q.row(0));
  BiasState state = model.state();
  state.sigma.setConstant(10e-6);
  const auto equal = BiasModel::restore(state);
  ASSERT_TRUE(equal.has_value());
  EXPECT_GT(vague.stddev_B[0], equal->predict(problem.q.row(0)).stddev_B[0]);
}

TEST(BiasModel, AMeasurementIsAsNoisyAsTheMeanOfThoseItLearnedFrom) {
  BiasProblem problem = smooth_problem(100, 13);
  problem.sigma.head(20).setConstant(20e-6);  // four times the variance of the median
  const BiasModel model = fit(problem);
  const BiasPrediction at = model.predict(JointVector::Zero(6));
  const double noise = std::pow(at.measured_stddev_B[1], 2) - std::pow(at.stddev_B[1], 2);
  EXPECT_NEAR(noise, (0.8 * 1 + 0.2 * 4) * std::pow(model.report().noise_stddev[1], 2),
              1e-6 * noise);
}

TEST(BiasModel, SurvivesAJointThatNeverMovesAndAnOutputThatIsZero) {
  BiasProblem problem = smooth_problem(80, 14);
  problem.q.col(5).setConstant(0.3);
  problem.residual_B.col(2).setZero();
  const BiasModel model = fit(problem);
  const BiasPrediction prediction = model.predict(problem.q.row(3));
  EXPECT_TRUE(prediction.mean_B.allFinite());
  EXPECT_NEAR(prediction.mean_B[2], 0.0, 1e-12);
}

TEST(BiasModel, SurvivesPosesThatWereMeasuredTwice) {
  BiasProblem problem = smooth_problem(60, 15);
  problem.q.bottomRows(30) = problem.q.topRows(30);
  EXPECT_TRUE(BiasModel::fit(problem, {}).has_value());
}

TEST(BiasModel, WithoutAKernelSaysZeroAndTheSpreadOfTheResidual) {
  BiasOptions options;
  options.kernel = "none";
  const BiasProblem problem = smooth_problem(50, 16);
  const BiasModel model = fit(problem, options);
  const BiasPrediction prediction = model.predict(problem.q.row(0));
  EXPECT_EQ(prediction.mean_B, Vector3::Zero());
  EXPECT_NEAR(prediction.stddev_B[1], std::sqrt(problem.residual_B.col(1).squaredNorm() / 50),
              1e-15);
  EXPECT_EQ(prediction.prior_share, 1.0);
  EXPECT_EQ(model.leave_one_out_mean_B(), Eigen::MatrixXd::Zero(50, 3));
  EXPECT_EQ(model.leave_one_out_stddev_B().row(49), prediction.stddev_B.transpose());
  EXPECT_TRUE(BiasModel::restore(model.state()).has_value());
}

TEST(BiasModel, WhatABlockLeftOutMissesIsWhatAModelOfTheRestMisses) {
  const BiasProblem problem = smooth_problem(90, 23);
  const BiasModel model = BiasModel::fit(problem, {}).value();
  Eigen::MatrixXd residual_B = problem.residual_B;
  residual_B.col(1).array() += 1e-4;  // the physics identified without the block says otherwise
  std::vector<Eigen::Index> block, rest;
  for (Eigen::Index i = 0; i < 90; ++i) (i % 7 == 3 ? block : rest).push_back(i);
  BiasState part = model.state();
  part.q = problem.q(rest, Eigen::all);
  part.residual_B = residual_B(rest, Eigen::all);
  part.sigma = problem.sigma(rest);
  const Eigen::MatrixXd known =
      BiasModel::restore(part).value().mean_all_B(problem.q(block, Eigen::all));
  const Eigen::MatrixXd error = model.left_out_error_B(residual_B, block).value();
  EXPECT_LT((error - (residual_B(block, Eigen::all) - known)).norm(), 1e-9 * residual_B.norm());
}

TEST(BiasModel, ReportsProgressAndStopsWhenToldTo) {
  double last = 0;
  BiasOptions options;
  options.progress = [&last](double share) {
    EXPECT_GE(share, last);
    EXPECT_LE(share, 1.0);
    last = share;
    return true;
  };
  EXPECT_TRUE(BiasModel::fit(smooth_problem(60, 17), options).has_value());
  EXPECT_DOUBLE_EQ(last, 1.0);
  options.progress = [](double share) { return share < 0.2; };
  const auto stopped = BiasModel::fit(smooth_problem(60, 17), options);
  ASSERT_FALSE(stopped.has_value());
  EXPECT_EQ(stopped.error().code, ErrorCode::kBusy);
  EXPECT_EQ(refusal_of(stopped), Refusal().of(ErrorCode::kBusy));
}

TEST(BiasModel, RefusesWhatItCannotLearnFrom) {
  const BiasProblem good = smooth_problem(20, 18);
  EXPECT_EQ(refusal_of(BiasModel::fit(smooth_problem(9, 18), BiasOptions{})),
            Refusal("bias data").beyond(9, 10));

  BiasProblem bad = good;
  bad.q(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal_of(BiasModel::fit(bad, BiasOptions{})),
            Refusal("bias data", 4, "joint 2").value(std::numeric_limits<double>::quiet_NaN()));

  bad = good;
  bad.residual_B(0, 2) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal_of(BiasModel::fit(bad, BiasOptions{})),
            Refusal("bias data", 1, "residual z").value(std::numeric_limits<double>::infinity()));

  bad = good;
  bad.sigma[6] = -0.001;
  EXPECT_EQ(refusal_of(BiasModel::fit(bad, BiasOptions{})),
            Refusal("bias data", 7, "sigma").beyond(-1, 0));

  bad = good;
  bad.sigma.conservativeResize(19);
  EXPECT_EQ(refusal_of(BiasModel::fit(bad, BiasOptions{})),
            Refusal("bias data", {}, "sigma").beyond(19, 20));

  BiasOptions options;
  options.kernel = "sea";
  EXPECT_EQ(refusal_of(BiasModel::fit(good, options)), Refusal("", {}, "bias").text("sea"));
  options.kernel = "se";
  options.starts = 0;
  EXPECT_EQ(refusal_of(BiasModel::fit(good, options)), Refusal("", {}, "starts").beyond(0, 1));
}

TEST(BiasModel, RefusesAStateThatDoesNotFit) {
  const BiasModel model = fit(smooth_problem(20, 19));
  BiasState state = model.state();
  state.hyperparameters.conservativeResize(5, 3);
  EXPECT_EQ(refusal_of(BiasModel::restore(state)), Refusal("", {}, "hyperparameters").beyond(5, 8));
  state = model.state();
  state.offset.resize(0);
  EXPECT_EQ(refusal_of(BiasModel::restore(state)), Refusal("", {}, "offset").beyond(0, 3));
  state = model.state();
  state.hyperparameters(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(BiasModel::restore(state).has_value());
}

}  // namespace
}  // namespace trammel
