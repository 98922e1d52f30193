#include <gtest/gtest.h>

#include "server/bias/process/gaussian_process.h"
#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const GpHyperparameters kSmooth = {(VectorXd(6) << 0.7, 0.8, 0.3, 0.5, 2.0, 2.0).finished(),
                                   std::log(2e-4), std::log(1e-5)};

struct Data {
  MatrixXd q;
  VectorXd y, noise_shape;
};

Data some_data(Index count) {
  const BiasProblem problem = smooth_problem(count, 61);
  VectorXd shape(count);
  for (Index i = 0; i < count; ++i) shape[i] = 0.5 + 0.5 * static_cast<double>(i % 4);
  return {problem.q, problem.residual_B.col(2), shape};
}

Data rows(const Data& data, const std::vector<Index>& which) {
  return {data.q(which, Eigen::all), data.y(which), data.noise_shape(which)};
}

GaussianProcess conditioned(const Data& data, VarianceForm form = VarianceForm::kExact,
                            double stretch = 0.0) {
  GpHyperparameters at = kSmooth;
  at.kernel.array() += stretch;
  auto gp =
      GaussianProcess::condition(make_kernel("se"), data.q, data.y, data.noise_shape, at, form);
  if (!gp) throw std::runtime_error("not positive definite");
  return *std::move(gp);
}

std::vector<Index> all_but(Index count, const std::vector<Index>& without) {
  std::vector<Index> kept;
  for (Index i = 0; i < count; ++i) {
    if (std::find(without.begin(), without.end(), i) == without.end()) kept.push_back(i);
  }
  return kept;
}

void expect_same(const GaussianProcess& a, const GaussianProcess& b) {
  const MatrixXd targets = random_joints(40, 62);
  VectorXd mean_a(40);
  VectorXd mean_b(40);
  a.mean(targets, mean_a.data());
  b.mean(targets, mean_b.data());
  EXPECT_LT((mean_a - mean_b).cwiseAbs().maxCoeff(), 1e-14) << "m";
  const auto variance_a = a.variance(targets);
  const auto variance_b = b.variance(targets);
  for (std::size_t i = 0; i < 40; ++i)
    EXPECT_NEAR(variance_a[i].posterior, variance_b[i].posterior, 1e-9 * variance_b[i].posterior);
  EXPECT_NEAR(a.log_likelihood(), b.log_likelihood(), 1e-8);
  EXPECT_LT((a.leave_one_out_mean() - b.leave_one_out_mean()).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((a.leave_one_out_share() - b.leave_one_out_share()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(GrowingProcess, WithMorePointsEqualsConditioningOnAllOfThem) {
  for (const Index count : {1, 23, 24, 25, 150}) {
    const Data data = some_data(count + 30);
    const std::vector<Index> fresh =
        all_but(count + 30, all_but(count + 30, {count, count + 7, count + 29}));
    std::vector<Index> first(static_cast<std::size_t>(count));
    for (Index i = 0; i < count; ++i) first[static_cast<std::size_t>(i)] = i;
    std::vector<Index> both = first;
    both.insert(both.end(), fresh.begin(), fresh.end());
    const Data more = rows(data, fresh);
    const auto grown = conditioned(rows(data, first)).with(more.q, more.y, more.noise_shape);
    ASSERT_TRUE(grown.has_value());
    expect_same(*grown, conditioned(rows(data, both)));
  }
}

TEST(GrowingProcess, WithoutPointsEqualsConditioningOnTheOthers) {
  const Data data = some_data(150);
  const GaussianProcess whole = conditioned(data);
  for (const std::vector<Index>& gone :
       {std::vector<Index>{0}, {149}, {75}, {0, 1, 2, 3}, {5, 70, 71, 148, 149}, {24, 47, 48}}) {
    expect_same(whole.without(gone), conditioned(rows(data, all_but(150, gone))));
  }
}

TEST(GrowingProcess, ComesBackToItselfAfterAHundredExchanges) {
  const Data data = some_data(80);
  GaussianProcess gp = conditioned(data);
  for (Index i = 0; i < 100; ++i) {
    const Data moved = rows(data, {i % 80});
    gp = *gp.without({0}).with(moved.q, moved.y, moved.noise_shape);
  }
  const std::vector<Index> order = [] {
    std::vector<Index> turned;
    for (Index i = 0; i < 80; ++i) turned.push_back((i + 100) % 80);
    return turned;
  }();
  expect_same(gp, conditioned(rows(data, order)));
}

TEST(GrowingProcess, RefusesAPointThatRepeatsAnotherWithoutNoise) {
  const Data data = some_data(30);
  const auto grown =
      conditioned(data).with(data.q.topRows(1), data.y.head(1), VectorXd::Constant(1, -1.0));
  EXPECT_FALSE(grown.has_value());
}

// The few points that stand for all of them, against all of them.
TEST(CompressedVariance, IsTheExactOneToAPerCentAndNeverClearlyBelow) {
  const Data data = some_data(600);
  const GaussianProcess exact = conditioned(data, VarianceForm::kExact, 0.4);
  const GaussianProcess compressed = conditioned(data, VarianceForm::kCompressed, 0.4);
  ASSERT_LT(compressed.variance_points(), 400);
  EXPECT_EQ(exact.variance_points(), 600);
  MatrixXd targets(700, 6);
  targets << random_joints(500, 63), data.q.topRows(100), 1.5 * random_joints(100, 64);
  const auto expected = exact.variance(targets);
  const auto got = compressed.variance(targets);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double stddev = std::sqrt(expected[i].posterior);
    EXPECT_GT(std::sqrt(got[i].posterior), stddev * (1 - 0.002)) << i;
    EXPECT_LT(std::sqrt(got[i].posterior), stddev * (1 + 0.03) + 0.05e-6) << i;
    EXPECT_EQ(got[i].prior, expected[i].prior);
  }
}

TEST(CompressedVariance, IsThePriorFarFromAllData) {
  const GaussianProcess compressed = conditioned(some_data(600), VarianceForm::kCompressed, 0.4);
  const auto far = compressed.variance(MatrixXd::Constant(1, 6, 1000.0)).front();
  EXPECT_EQ(far.posterior, far.prior);
}

TEST(CompressedVariance, IsExactWhereFewPointsDoNotStandForAll) {
  const Data data = some_data(300);
  GpHyperparameters rough = kSmooth;
  rough.kernel.setConstant(-1.0);
  const auto gp =
      GaussianProcess::condition(make_kernel("matern32"), data.q, data.y, data.noise_shape, rough);
  ASSERT_TRUE(gp.has_value());
  EXPECT_EQ(gp->variance_points(), 300);
}

}  // namespace
}  // namespace trammel
