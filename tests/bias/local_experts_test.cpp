#include "server/bias/process/local_experts.h"

#include <gtest/gtest.h>

#include "server/bias/process/halves.h"
#include "server/bias/search/hyperparameter_search.h"
#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const GpHyperparameters kSmooth = {(VectorXd(6) << 0.7, 0.8, 0.3, 0.5, 2.0, 2.0).finished(),
                                   std::log(2e-4), std::log(10e-6)};

LocalExperts conditioned(const BiasProblem& problem, Index count,
                         const GpHyperparameters& at = kSmooth) {
  auto local =
      LocalExperts::condition(make_kernel("se"), problem.q.topRows(count),
                              problem.residual_B.col(2).head(count), VectorXd::Ones(count), at);
  if (!local) throw std::runtime_error("not positive definite");
  return *std::move(local);
}

TEST(LocalExperts, AreOneExactProcessUpTo5000Points) {
  const BiasProblem problem = smooth_problem(300, 71);
  const LocalExperts local = conditioned(problem, 300);
  EXPECT_EQ(local.experts(), 1U);
  const auto exact = GaussianProcess::condition(
      make_kernel("se"), problem.q, problem.residual_B.col(2), VectorXd::Ones(300), kSmooth);
  const MatrixXd q = random_joints(20, 72);
  VectorXd mean(20);
  VectorXd expected(20);
  local.mean(q, mean.data());
  exact->mean(q, expected.data());
  EXPECT_EQ(mean, expected);
  EXPECT_EQ(local.leave_one_out_mean(), exact->leave_one_out_mean());
}

TEST(LocalExperts, NoneIsGivenAPartOfAPose) {
  // Grids of two joints: many poses have the same value of the joint across which they are halved.
  MatrixXd q = MatrixXd::Zero(3 * 700, 6);
  for (Index row = 0; row < q.rows(); ++row) {
    q(row, 1) = 0.05 * static_cast<double>(row % 700 / 27);
    q(row, 2) = 0.05 * static_cast<double>(row % 700 % 27);
  }
  std::vector<int> part_of(static_cast<std::size_t>(q.rows()), -1);
  int part = 0;
  for (const std::vector<Index>& rows : halved(q, pose_groups(q), 40)) {
    for (const Index row : rows) part_of[static_cast<std::size_t>(row)] = part;
    ++part;
  }
  EXPECT_GE(part, 700 / 40);
  for (std::size_t row = 0; row < 700; ++row) {
    EXPECT_EQ(part_of[row], part_of[row + 700]);
    EXPECT_EQ(part_of[row], part_of[row + 1400]);
  }
}

TEST(LocalExperts, LeaveAllReflectorsOfAPoseOutTogether) {
  // An error of each pose that no other pose shares: whoever is left out with the others of its
  // pose is predicted as 0.
  constexpr Index kPoses = 1700;
  const MatrixXd at = random_joints(kPoses, 75);
  const MatrixXd q = at.replicate(3, 1);
  std::mt19937_64 random(76);
  VectorXd y(kPoses);
  for (double& value : y) value = 1e-4 * normal(&random);
  GpHyperparameters rough = kSmooth;
  rough.kernel = VectorXd::Constant(6, std::log(1e-2));
  const auto local = LocalExperts::condition(make_kernel("se"), q, y.replicate(3, 1),
                                             VectorXd::Ones(3 * kPoses), rough);
  ASSERT_TRUE(local);
  ASSERT_GT(local->experts(), 1U);
  EXPECT_LT(local->leave_one_out_mean().cwiseAbs().maxCoeff(), 1e-9);
}

class ManyPoints : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    problem_ = std::make_unique<BiasProblem>(smooth_problem(6010, 73));
    local_ = std::make_unique<LocalExperts>(conditioned(*problem_, 6000));
  }
  static std::unique_ptr<BiasProblem> problem_;
  static std::unique_ptr<LocalExperts> local_;
};
std::unique_ptr<BiasProblem> ManyPoints::problem_;
std::unique_ptr<LocalExperts> ManyPoints::local_;

TEST_F(ManyPoints, AreLearnedToTheNoiseWithIntervalsThatHold) {
  EXPECT_GT(local_->experts(), 4U);
  const GpData part{problem_->q.topRows(800), problem_->residual_B.col(2).head(800),
                    VectorXd::Ones(800)};
  const auto found = search_hyperparameters(make_kernel("se"), part, 10e-6, {});
  const LocalExperts local = conditioned(*problem_, 6000, found->outputs.front());
  const BiasProblem fresh = smooth_problem(3000, 74);
  VectorXd mean(3000);
  local.mean(fresh.q, mean.data());
  const auto variance = local.variance(fresh.q);
  double square = 0;
  int inside = 0;
  for (Index i = 0; i < 3000; ++i) {
    const double error = mean[i] - smooth_error_B(fresh.q.row(i))[2];
    const double sigma =
        std::sqrt(variance[static_cast<std::size_t>(i)].posterior + local.noise_variance());
    square += error * error;
    inside += std::abs(fresh.residual_B(i, 2) - mean[i]) < 1.96 * sigma;
  }
  EXPECT_LT(std::sqrt(square / 3000), 5e-6) << "m, half of the noise of a measurement";
  EXPECT_NEAR(inside / 3000.0, 0.95, 0.02);
}

TEST_F(ManyPoints, ArePredictedWithoutAStepBetweenExperts) {
  const MatrixXd ends = random_joints(2, 75);
  constexpr Index kSteps = 4000;
  MatrixXd line(kSteps + 1, 6);
  for (Index i = 0; i <= kSteps; ++i)
    line.row(i) = ends.row(0) + (ends.row(1) - ends.row(0)) * (static_cast<double>(i) / kSteps);
  VectorXd mean(kSteps + 1);
  local_->mean(line, mean.data());
  const auto variance = local_->variance(line);
  // A step would stand out among second differences, which shrink with the square of the distance.
  for (Index i = 1; i < kSteps; ++i) {
    EXPECT_LT(std::abs(mean[i + 1] - 2 * mean[i] + mean[i - 1]), 1e-9);
    const auto at = [&](Index j) {
      return std::sqrt(variance[static_cast<std::size_t>(j)].posterior);
    };
    EXPECT_LT(std::abs(at(i + 1) - 2 * at(i) + at(i - 1)), 1e-9);
  }
}

TEST_F(ManyPoints, AreThePriorFarFromAllOfThem) {
  const MatrixXd far = MatrixXd::Constant(1, 6, 1000.0);
  double mean = 1;
  local_->mean(far, &mean);
  EXPECT_EQ(mean, 0.0);
  EXPECT_DOUBLE_EQ(local_->variance(far).front().posterior, local_->signal_variance());
}

TEST_F(ManyPoints, TakeMorePointsAndGiveThemBack) {
  const auto grown = local_->with(problem_->q.bottomRows(10), problem_->residual_B.col(2).tail(10),
                                  VectorXd::Ones(10));
  ASSERT_TRUE(grown.has_value());
  EXPECT_EQ(grown->size(), 6010);
  const MatrixXd q = problem_->q.bottomRows(10);
  const auto before = local_->variance(q);
  const auto after = grown->variance(q);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_LT(after[i].posterior, before[i].posterior);

  std::vector<Index> fresh;
  for (Index i = 6000; i < 6010; ++i) fresh.push_back(i);
  const LocalExperts back = grown->without(fresh);
  EXPECT_EQ(back.size(), 6000);
  EXPECT_LT((back.leave_one_out_mean() - local_->leave_one_out_mean()).cwiseAbs().maxCoeff(),
            1e-13);
}

TEST_F(ManyPoints, AreConditionedTheSameBitForBitEachTime) {
  const LocalExperts again = conditioned(*problem_, 6000);
  const MatrixXd q = random_joints(30, 76);
  VectorXd a(30);
  VectorXd b(30);
  local_->mean(q, a.data());
  again.mean(q, b.data());
  EXPECT_EQ(a, b);
}

}  // namespace
}  // namespace trammel
