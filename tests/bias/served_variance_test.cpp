#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "server/bias/process/gaussian_process.h"
#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct ServedVarianceCase {
  const char* kernel;
  double length;  // scale of every joint, rad, over a range of 2.4 rad
  double noise;   // variance, relative to the signal's
  Index poses;
  const char* layout;
  Index joints = 6;
};

std::string name_of(const testing::TestParamInfo<ServedVarianceCase>& info) {
  return std::to_string(info.index) + "_" + info.param.layout;
}

MatrixXd poses_of(const ServedVarianceCase& of) {
  MatrixXd q = random_joints(of.poses, 91, of.joints);
  const std::string layout = of.layout;
  if (layout == "twice") q.bottomRows(of.poses / 2) = q.topRows(of.poses / 2);
  if (layout == "clusters") {
    for (Index i = 0; i < of.poses; ++i) q.row(i) = q.row(i % 5) + 0.03 * q.row(i);
  }
  if (layout == "flat") q.rightCols(3) *= 1e-3;
  if (layout == "line") {
    for (Index i = 0; i < of.poses; ++i) q.row(i) = q.row(0) + q(i, 0) * (q.row(1) - q.row(0));
  }
  if (layout == "rail") q.col(0) *= 2.0;  // m
  return q;
}

GaussianProcess process_of(const ServedVarianceCase& of, VarianceForm form) {
  const MatrixXd q = poses_of(of);
  VectorXd shape(of.poses);
  for (Index i = 0; i < of.poses; ++i) shape[i] = 0.5 + 0.25 * static_cast<double>(i % 5);
  const auto kernel = make_kernel(of.kernel);
  VectorXd parameters = VectorXd::Constant(kernel->parameter_count(of.joints), std::log(of.length));
  parameters[5] += 2;  // a joint of little influence
  auto gp = GaussianProcess::condition(
      kernel, q, q.col(0), shape,
      {parameters, std::log(1e-4), std::log(1e-4) + 0.5 * std::log(of.noise)}, form);
  if (!gp) throw std::runtime_error("not positive definite");
  return *std::move(gp);
}

// Training poses, poses near them and between them, the whole range, and beyond it.
MatrixXd targets_of(const ServedVarianceCase& of) {
  const MatrixXd q = poses_of(of);
  const Index n = std::min<Index>(120, of.poses);
  const Eigen::RowVectorXd middle = 0.5 * (q.colwise().maxCoeff() + q.colwise().minCoeff());
  const Eigen::RowVectorXd half =
      (q.colwise().maxCoeff() - middle) / 1.2;  // random_joints() reach 1.2
  const auto in_range = [&](double stretch, std::uint64_t seed) -> MatrixXd {
    return (stretch * random_joints(n, seed, of.joints) * half.asDiagonal()).rowwise() + middle;
  };
  MatrixXd targets(5 * n, of.joints);
  targets << q.topRows(n),
      q.topRows(n) + MatrixXd(0.02 * random_joints(n, 92, of.joints) * half.asDiagonal()),
      0.5 * (q.topRows(n) + q.bottomRows(n)), in_range(1, 93), in_range(1.5, 94);
  return targets;
}

class ServedVariance : public testing::TestWithParam<ServedVarianceCase> {};

TEST_P(ServedVariance, IsNeverBelowTheExactOneAndHardlyAbove) {
  const GaussianProcess exact = process_of(GetParam(), VarianceForm::kExact);
  const GaussianProcess served = process_of(GetParam(), VarianceForm::kServed);
  const MatrixXd targets = targets_of(GetParam());
  const std::vector<PosteriorVariance> expected = exact.variance(targets);
  const std::vector<PosteriorVariance> got = served.variance(targets);
  const double noise = exact.noise_variance();
  std::vector<double> rises;
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_EQ(got[i].prior, expected[i].prior);
    const double measured = expected[i].posterior + noise;
    EXPECT_GE(got[i].posterior, expected[i].posterior - 1e-6 * measured) << i;
    rises.push_back(std::sqrt((got[i].posterior + noise) / measured) - 1);
    EXPECT_LT(rises.back(), 0.02) << i;
  }
  std::sort(rises.begin(), rises.end());
  EXPECT_LT(rises[rises.size() / 2], 0.005);
}

// The share of the prior variance that is left tells whether a pose is in domain.
TEST_P(ServedVariance, KeepsTheShareThatSaysWhatIsInDomain) {
  const GaussianProcess exact = process_of(GetParam(), VarianceForm::kExact);
  const GaussianProcess served = process_of(GetParam(), VarianceForm::kServed);
  const MatrixXd targets = targets_of(GetParam());
  const std::vector<PosteriorVariance> expected = exact.variance(targets);
  const std::vector<PosteriorVariance> got = served.variance(targets);
  std::vector<double> rises;
  for (std::size_t i = 0; i < got.size(); ++i)
    rises.push_back((got[i].posterior - expected[i].posterior) /
                    (expected[i].posterior + 1e-3 * exact.noise_variance()));
  std::sort(rises.begin(), rises.end());
  EXPECT_LT(rises[rises.size() * 9 / 10], 0.1);
}

TEST_P(ServedVariance, IsTheSameAloneAndAmongOthersServedOrLearned) {
  const GaussianProcess one = process_of(GetParam(), VarianceForm::kServed);
  const GaussianProcess other = process_of(GetParam(), VarianceForm::kLearned);
  const MatrixXd targets = targets_of(GetParam());
  const std::vector<PosteriorVariance> together = one.variance(targets);
  for (Index i = targets.rows() - 1; i >= 0; i -= 7) {
    const double alone = other.variance(targets.row(i)).front().posterior;
    EXPECT_NEAR(alone, together[static_cast<std::size_t>(i)].posterior, 1e-9 * one.noise_variance())
        << i;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Kernels, ServedVariance,
    testing::Values(ServedVarianceCase{"se", 0.9, 0.07, 700, "scattered"},
                    ServedVarianceCase{"se", 0.9, 0.005, 500, "scattered"},
                    ServedVarianceCase{"se", 0.05, 0.07, 400, "scattered"},
                    ServedVarianceCase{"se", 8.0, 1e-6, 400, "scattered"},
                    ServedVarianceCase{"se", 0.5, 3.0, 400, "scattered"},
                    ServedVarianceCase{"se", 0.6, 1e-7, 300, "scattered"},
                    ServedVarianceCase{"se", 0.7, 0.02, 500, "twice"},
                    ServedVarianceCase{"se", 0.3, 0.02, 500, "clusters"},
                    ServedVarianceCase{"se", 1.5, 20.0, 500, "clusters"},
                    ServedVarianceCase{"se", 0.7, 0.02, 400, "flat"},
                    ServedVarianceCase{"se", 0.4, 0.05, 400, "line"},
                    ServedVarianceCase{"se", 0.3, 10.0, 1200, "scattered"},
                    ServedVarianceCase{"se", 1.5, 5.0, 600, "scattered"},
                    ServedVarianceCase{"se", 0.6, 1e3, 500, "scattered"},
                    ServedVarianceCase{"se", 0.9, 0.07, 50, "scattered"},
                    ServedVarianceCase{"se", 1.5, 0.02, 600, "rail", 7},
                    ServedVarianceCase{"matern52", 1.0, 0.05, 500, "scattered"},
                    ServedVarianceCase{"matern32", 0.8, 0.3, 400, "twice"},
                    ServedVarianceCase{"rational_quadratic", 1.0, 0.05, 400, "scattered"},
                    ServedVarianceCase{"matern52", 3.0, 80.0, 500, "rail", 7},
                    ServedVarianceCase{"se * matern32", 1.5, 0.1, 300, "scattered"}),
    name_of);

TEST(ServedVarianceOfScatteredPoses, IsThePriorFarFromAllData) {
  for (const double noise : {0.05, 10.0}) {
    const GaussianProcess gp =
        process_of({"se", 0.3, noise, 500, "scattered"}, VarianceForm::kServed);
    const PosteriorVariance far = gp.variance(MatrixXd::Constant(1, 6, 1000.0)).front();
    EXPECT_EQ(far.posterior, far.prior);
  }
}

TEST(ServedVarianceOfScatteredPoses, ReadsFewPointsWhereTheseSayAsMuchAsAll) {
  EXPECT_LE(
      process_of({"se", 0.3, 10.0, 1200, "scattered"}, VarianceForm::kServed).variance_points(),
      48);
  EXPECT_LE(
      process_of({"se", 8.0, 0.05, 1200, "scattered"}, VarianceForm::kServed).variance_points(),
      400);
}

}  // namespace
}  // namespace trammel
