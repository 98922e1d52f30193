#include "server/diagnose/evidence/dependence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>

#include "server/diagnose/diagnose.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

using Eigen::MatrixXd;

MatrixXd drawn(Eigen::Index rows, Eigen::Index columns, std::mt19937_64& random,
               bool normal = true) {
  std::normal_distribution<double> bell;
  std::uniform_real_distribution<double> flat(-1, 1);
  MatrixXd m(rows, columns);
  for (double& value : m.reshaped()) value = normal ? bell(random) : flat(random);
  return m;
}

TEST(Dependence, WhatDoesNotDependHasEveryPValueAsOften) {
  std::mt19937_64 random(1);
  std::vector<double> p;
  for (std::uint64_t seed = 0; seed < 2000; ++seed)
    p.push_back(independence_p_value(drawn(40, 1, random, false), drawn(40, 3, random), seed));
  for (const double share : {0.5, 0.1, 0.05, 0.01}) {
    const auto below = std::count_if(p.begin(), p.end(), [&](double one) { return one <= share; });
    const double expected = 2000 * share;
    EXPECT_NEAR(static_cast<double>(below), expected, 4 * std::sqrt(expected)) << share;
  }
  // The tail beyond all permutations is no nearer than it says either.
  EXPECT_LE(std::count_if(p.begin(), p.end(), [](double one) { return one <= 0.001; }), 8);
  EXPECT_GE(*std::min_element(p.begin(), p.end()), 2e-5);
}

MatrixXd centred_distances(const MatrixXd& rows) {
  MatrixXd d(rows.rows(), rows.rows());
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    d.col(i) = (rows.rowwise() - rows.row(i)).rowwise().norm();
  const Eigen::VectorXd mean = d.rowwise().mean();
  const double whole = mean.mean();
  d = ((d.colwise() - mean).rowwise() - mean.transpose()).eval();
  d.array() += whole;
  return d;
}

/// The share of very many permutations that are as large; empty where even these are too few to
/// know.
std::optional<double> by_many_permutations(const MatrixXd& x, const MatrixXd& y,
                                           std::mt19937_64& random) {
  constexpr int kDraws = 40000;
  constexpr int kEnough = 12;
  const MatrixXd a = centred_distances(x);
  const MatrixXd b = centred_distances(y);
  std::vector<int> order(static_cast<std::size_t>(x.rows()));
  std::iota(order.begin(), order.end(), 0);
  const double observed = a.cwiseProduct(b).sum();
  int above = 0;
  for (int k = 0; k < kDraws; ++k) {
    std::shuffle(order.begin(), order.end(), random);
    if (a.cwiseProduct(b(order, order)).sum() >= observed) ++above;
  }
  return above < kEnough ? std::nullopt : std::optional(above / static_cast<double>(kDraws));
}

TEST(Dependence, TheTailIsThatOfManyMorePermutations) {
  std::mt19937_64 random(3);
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    const MatrixXd x = drawn(60, 1, random, false);
    MatrixXd y = drawn(60, 3, random);
    y.col(0) += 0.7 * x;
    const double p = independence_p_value(x, y, seed);
    if (p >= 0.01) continue;  // by permutation itself
    const std::optional<double> exact = by_many_permutations(x, y, random);
    if (!exact) continue;
    ++compared;
    EXPECT_LT(std::abs(std::log(p / *exact)), std::log(3.0))
        << seed << ": " << p << " and " << *exact;
  }
  EXPECT_GE(compared, 3);
}

TEST(Dependence, AStrongDependenceSaysYesAmongSixteenQuestions) {
  std::mt19937_64 random(2);
  const MatrixXd x = drawn(150, 1, random, false);
  MatrixXd y = 0.3 * drawn(150, 3, random);
  y.col(1) += x;
  EXPECT_LE(independence_p_value(x, y, 1), 1e-6);
}

/// The virtual robot of cell-7 and what is left of its batch, judged against every question.
std::vector<Dependence> left_of(const MeasurementBatch& batch) {
  DiagnoseOptions options;
  options.recovery = false;
  options.next_poses = 0;
  return test::demand(diagnose(test::cell_7(), batch, options)).leftover;
}

TEST(Dependence, TheTableOfADiagnosisSaysYesWhereNoiseGrowsWithAJoint) {
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 150, 7);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (Measurement& m : batch.measurements) {
    const double sigma = m.context.q(0) > 0 ? 60e-6 : 0;
    m.p_W += sigma * Vector3(normal(random), normal(random), normal(random));
  }
  const std::vector<Dependence> table = left_of(batch);
  ASSERT_FALSE(table.empty());
  EXPECT_EQ(table.front().on, "q1");
  EXPECT_LT(table.front().p_value, 1e-4);
}

TEST(Dependence, TheTableOfNoiseAloneSaysNo) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    for (const Dependence& one :
         left_of(test::measured(test::chapter_5_robot(test::cell_7()), 80, seed)))
      EXPECT_GT(one.p_value, 0.01) << seed << " " << one.on;
  }
}

}  // namespace
}  // namespace trammel::cause_search
