#include <gtest/gtest.h>

#include <string>
#include <thread>

#include "server/bias/process/gaussian_process.h"
#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Case {
  const char* kernel;
  double length;  // scale of every joint, rad, over a range of 2 rad
  double noise;   // variance, relative to the signal's
  Index poses;
  const char* layout;
};

std::string name_of(const testing::TestParamInfo<Case>& info) {
  return std::to_string(info.index) + "_" + info.param.layout;
}

MatrixXd poses_of(const Case& of) {
  MatrixXd q = random_joints(of.poses, 91);
  const std::string layout = of.layout;
  if (layout == "twice") q.bottomRows(of.poses / 2) = q.topRows(of.poses / 2);
  if (layout == "clusters") {
    for (Index i = 0; i < of.poses; ++i) q.row(i) = q.row(i % 5) + 0.03 * q.row(i);
  }
  if (layout == "flat") q.rightCols(3) *= 1e-3;
  if (layout == "line") {
    for (Index i = 0; i < of.poses; ++i) q.row(i) = q.row(0) + q(i, 0) * (q.row(1) - q.row(0));
  }
  return q;
}

GaussianProcess process_of(const Case& of, VarianceForm form) {
  const MatrixXd q = poses_of(of);
  VectorXd shape(of.poses);
  for (Index i = 0; i < of.poses; ++i) shape[i] = 0.5 + 0.25 * static_cast<double>(i % 5);
  const auto kernel = make_kernel(of.kernel);
  VectorXd parameters = VectorXd::Constant(kernel->parameter_count(6), std::log(of.length));
  parameters[5] += 2;  // a joint of little influence
  auto gp = GaussianProcess::condition(kernel, q, q.col(0), shape,
                                       {parameters, std::log(1e-4), std::log(1e-4) + 0.5 * std::log(of.noise)}, form);
  if (!gp) throw std::runtime_error("not positive definite");
  return *std::move(gp);
}

// Training poses, poses near them and between them, the whole range, and beyond it.
MatrixXd targets_of(const Case& of) {
  const MatrixXd q = poses_of(of);
  const Index n = 120;
  const Eigen::RowVectorXd middle = 0.5 * (q.colwise().maxCoeff() + q.colwise().minCoeff());
  const Eigen::RowVectorXd half = (q.colwise().maxCoeff() - middle) / 1.2;  // random_joints() reach 1.2
  const auto in_range = [&](double stretch, std::uint64_t seed) -> MatrixXd {
    return (stretch * random_joints(n, seed) * half.asDiagonal()).rowwise() + middle;
  };
  MatrixXd targets(5 * n, 6);
  targets << q.topRows(n), q.topRows(n) + MatrixXd(0.02 * random_joints(n, 92) * half.asDiagonal()),
      0.5 * (q.topRows(n) + q.bottomRows(n)), in_range(1, 93), in_range(1.5, 94);
  return targets;
}

class VarianceByRegions : public testing::TestWithParam<Case> {};

TEST_P(VarianceByRegions, IsNeverBelowTheExactOneAndHardlyAbove) {
  const GaussianProcess exact = process_of(GetParam(), VarianceForm::kExact);
  const MatrixXd targets = targets_of(GetParam());
  const std::vector<PosteriorVariance> expected = exact.variance(targets);
  const double noise = exact.noise_variance();
  for (const auto& [form, most] : {std::pair{VarianceForm::kRegional, 0.02}, {VarianceForm::kRough, 0.06}}) {
    const GaussianProcess process = process_of(GetParam(), form);
    const std::vector<PosteriorVariance> got = process.variance(targets);
    // Few points that stand for all of them err on the low side a little (VarianceForm::kCompressed).
    const double least = process.variance_points() < GetParam().poses ? 1 - 0.004 : 1;
    int much = 0;
    for (std::size_t i = 0; i < got.size(); ++i) {
      EXPECT_EQ(got[i].prior, expected[i].prior);
      EXPECT_GE(got[i].posterior, least * expected[i].posterior - 1e-9 * expected[i].prior - 1e-6 * noise) << i;
      const double rise = std::sqrt((got[i].posterior + noise) / (expected[i].posterior + noise)) - 1;
      EXPECT_LT(rise, 3 * most) << i;
      much += rise > most ? 1 : 0;
    }
    EXPECT_LT(much, 0.08 * static_cast<double>(got.size()));
  }
}

TEST_P(VarianceByRegions, IsTheSameAloneAndAmongOthersWhoeverAsksFirst) {
  const GaussianProcess one = process_of(GetParam(), VarianceForm::kRegional);
  const GaussianProcess other = process_of(GetParam(), VarianceForm::kRegional);
  const MatrixXd targets = targets_of(GetParam());
  const std::vector<PosteriorVariance> together = one.variance(targets);
  other.prepare([] { return true; });
  for (Index i = targets.rows() - 1; i >= 0; i -= 7)
    EXPECT_EQ(other.variance(targets.row(i)).front().posterior, together[static_cast<std::size_t>(i)].posterior) << i;
}

INSTANTIATE_TEST_SUITE_P(
    Kernels, VarianceByRegions,
    testing::Values(Case{"se", 0.9, 0.07, 700, "scattered"}, Case{"se", 0.9, 0.005, 500, "scattered"},
                    Case{"se", 0.05, 0.07, 400, "scattered"}, Case{"se", 8.0, 1e-6, 400, "scattered"},
                    Case{"se", 0.5, 3.0, 400, "scattered"}, Case{"se", 0.6, 1e-7, 300, "scattered"},
                    Case{"se", 0.7, 0.02, 500, "twice"}, Case{"se", 0.3, 0.02, 500, "clusters"},
                    Case{"se", 0.7, 0.02, 400, "flat"}, Case{"se", 0.4, 0.05, 400, "line"},
                    Case{"matern52", 1.0, 0.05, 500, "scattered"}, Case{"matern32", 0.8, 0.3, 400, "twice"},
                    Case{"rational_quadratic", 1.0, 0.05, 400, "scattered"},
                    Case{"se * matern32", 1.5, 0.1, 300, "scattered"}),
    name_of);

TEST(VarianceByRegionsOfScatteredPoses, IsWorkedOutOnceHoweverManyAskAtOnce) {
  const Case of = {"se", 0.9, 0.05, 500, "scattered"};
  const GaussianProcess gp = process_of(of, VarianceForm::kRegional);
  const std::vector<PosteriorVariance> expected = process_of(of, VarianceForm::kRegional).variance(targets_of(of));
  std::vector<std::vector<PosteriorVariance>> got(4);
  {
    std::vector<std::jthread> threads;
    for (auto& answer : got) threads.emplace_back([&] { answer = gp.variance(targets_of(of)); });
  }
  for (const auto& answer : got) {
    for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(answer[i].posterior, expected[i].posterior);
  }
}

TEST(VarianceByRegionsOfScatteredPoses, IsThePriorFarFromAllData) {
  const GaussianProcess gp = process_of({"se", 0.9, 0.05, 500, "scattered"}, VarianceForm::kRegional);
  const PosteriorVariance far = gp.variance(MatrixXd::Constant(1, 6, 1000.0)).front();
  EXPECT_EQ(far.posterior, far.prior);
}

}  // namespace
}  // namespace trammel
