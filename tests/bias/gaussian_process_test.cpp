#include "server/bias/process/gaussian_process.h"

#include <gtest/gtest.h>

#include <numbers>

#include "server/bias/search/hyperparameter_search.h"
#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double reference_kernel(const std::string& name, const VectorXd& log_scales, const VectorXd& a,
                        const VectorXd& b) {
  const double r = ((a - b).array() * (-log_scales.array()).exp()).matrix().norm();
  if (name == "se") return std::exp(-0.5 * r * r);
  if (name == "matern32") return (1 + std::sqrt(3.0) * r) * std::exp(-std::sqrt(3.0) * r);
  return (1 + std::sqrt(5.0) * r + 5.0 / 3.0 * r * r) * std::exp(-std::sqrt(5.0) * r);
}

MatrixXd reference_covariance(const std::string& name, const VectorXd& log_scales,
                              const MatrixXd& a, const MatrixXd& b) {
  MatrixXd k(a.rows(), b.rows());
  for (Index i = 0; i < a.rows(); ++i) {
    for (Index j = 0; j < b.rows(); ++j)
      k(i, j) = reference_kernel(name, log_scales, a.row(i), b.row(j));
  }
  return k;
}

VectorXd some_scales(Index joints) {
  VectorXd log_scales(joints);
  for (Index k = 0; k < joints; ++k) log_scales[k] = 0.2 + 0.15 * static_cast<double>(k % 5);
  return log_scales;
}

VectorXd some_noise_shape(Index count) {
  VectorXd shape(count);
  for (Index i = 0; i < count; ++i) shape[i] = 0.5 + static_cast<double>(i % 4);
  return shape;
}

GpPrior flat_prior(Index joints) {
  GpPrior prior;
  prior.noise_stddev = 1e-30;
  prior.parameter_centre = VectorXd::Zero(joints);
  prior.parameter_spread = 1e9;
  prior.log_ratio_spread = 1e9;
  return prior;
}

struct Case {
  std::string kernel;
  Index count;
  Index joints;
};

class EveryKernel : public testing::TestWithParam<Case> {
 protected:
  GpData data() const {
    const BiasProblem problem = smooth_problem(GetParam().count, 21, 20e-6);
    return {random_joints(GetParam().count, 22, GetParam().joints), problem.residual_B,
            some_noise_shape(GetParam().count)};
  }
};

TEST_P(EveryKernel, LikelihoodAndPredictionEqualTheDenseFormula) {
  const auto& [name, count, joints] = GetParam();
  const GpData d = data();
  const VectorXd log_scales = some_scales(joints);
  const double signal = 2e-4;
  const double noise = 2e-5;
  const VectorXd y = d.y.col(1);
  const auto gp = GaussianProcess::condition(make_kernel(name), d.q, y, d.noise_shape,
                                             {log_scales, std::log(signal), std::log(noise)});
  ASSERT_TRUE(gp.has_value());

  MatrixXd covariance = signal * signal * reference_covariance(name, log_scales, d.q, d.q);
  covariance.diagonal() += noise * noise * d.noise_shape;
  const Eigen::LLT<MatrixXd> factor(covariance);
  const VectorXd alpha = factor.solve(y);
  const double log_det = 2.0 * MatrixXd(factor.matrixL()).diagonal().array().log().sum();
  const double expected =
      -0.5 * (y.dot(alpha) + log_det + static_cast<double>(count) * std::log(2 * std::numbers::pi));
  EXPECT_NEAR(gp->log_likelihood(), expected, 1e-8 * std::abs(expected));

  const MatrixXd targets = random_joints(11, 23, joints);
  const MatrixXd cross = signal * signal * reference_covariance(name, log_scales, d.q, targets);
  const VectorXd expected_mean = cross.transpose() * alpha;
  const MatrixXd solved = factor.solve(cross);
  VectorXd mean(targets.rows());
  gp->mean(targets, mean.data());
  const auto variance = gp->variance(targets);
  for (Index j = 0; j < targets.rows(); ++j) {
    EXPECT_NEAR(mean[j], expected_mean[j], 1e-12);
    const double posterior = signal * signal - cross.col(j).dot(solved.col(j));
    EXPECT_NEAR(variance[static_cast<std::size_t>(j)].posterior, posterior,
                1e-10 * signal * signal);
    EXPECT_NEAR(variance[static_cast<std::size_t>(j)].prior, signal * signal, 1e-20);
  }
}

TEST_P(EveryKernel, ProfiledLikelihoodEqualsTheLikelihoodAtItsSignalVariance) {
  const auto& [name, count, joints] = GetParam();
  const GpData d = data();
  ProfiledLikelihood likelihood(make_kernel(name), d, flat_prior(joints));
  VectorXd parameters(joints + 1);
  parameters << some_scales(joints), std::log(0.02);
  ObjectiveValue evaluation;
  ASSERT_TRUE(likelihood.evaluate(parameters, &evaluation));
  double total = 0;
  for (Index output = 0; output < 3; ++output) {
    const double log_signal = 0.5 * std::log(likelihood.signal_variance()[output]);
    const auto gp = GaussianProcess::condition(
        make_kernel(name), d.q, d.y.col(output), d.noise_shape,
        {parameters.head(joints), log_signal, log_signal + 0.5 * parameters[joints]});
    ASSERT_TRUE(gp.has_value());
    total -= gp->log_likelihood();
  }
  EXPECT_NEAR(evaluation.value, total, 1e-7 * std::abs(total));
}

TEST_P(EveryKernel, GradientEqualsCentralDifferences) {
  const auto& [name, count, joints] = GetParam();
  GpPrior prior;  // with priors that all pull
  prior.parameter_centre = VectorXd::Constant(joints, 1.0);
  prior.noise_stddev = 5e-4;
  ProfiledLikelihood likelihood(make_kernel(name), data(), prior);
  VectorXd parameters(joints + 1);
  parameters << some_scales(joints), std::log(0.02);
  ObjectiveValue evaluation;
  ASSERT_TRUE(likelihood.evaluate(parameters, &evaluation));
  const double scale = evaluation.gradient.cwiseAbs().maxCoeff();
  for (Index p = 0; p <= joints; ++p) {
    const double h = 1e-4;
    const auto at = [&](double offset) {
      VectorXd moved = parameters;
      moved[p] += offset;
      ObjectiveValue there;
      EXPECT_TRUE(likelihood.evaluate(moved, &there));
      return there.value;
    };
    const double numeric = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
    EXPECT_NEAR(evaluation.gradient[p], numeric, 1e-6 * scale) << "parameter " << p;
  }
}

// Sizes on both sides of the blocks of the factorisation and of the tiles; six and seven joints,
// and neither.
INSTANTIATE_TEST_SUITE_P(Sizes, EveryKernel,
                         testing::Values(Case{"se", 13, 6}, Case{"se", 64, 3}, Case{"se", 150, 7},
                                         Case{"se", 411, 6}, Case{"matern32", 97, 6},
                                         Case{"matern32", 40, 2}, Case{"matern52", 130, 6},
                                         Case{"matern52", 30, 9}),
                         [](const auto& test) {
                           return test.param.kernel + "_" + std::to_string(test.param.count) + "_" +
                                  std::to_string(test.param.joints);
                         });

TEST(GaussianProcess, RefusesACovarianceThatIsNotPositiveDefinite) {
  const MatrixXd q = MatrixXd::Zero(20, 6);
  const auto gp = GaussianProcess::condition(make_kernel("se"), q, VectorXd::Ones(20),
                                             VectorXd::Ones(20), {VectorXd::Zero(6), 0.0, -40.0});
  EXPECT_FALSE(gp.has_value());
}

TEST(HyperparameterSearch, RecoversTheProcessThatTheDataWereDrawnFrom) {
  const Index count = 600;
  const Index joints = 3;
  const VectorXd log_scales = Eigen::Vector3d(0.5, 1.0, 2.0).array().log();
  const double signal = 3e-4;
  const double noise = 1e-5;
  const MatrixXd q = random_joints(count, 31, joints);
  MatrixXd covariance = reference_covariance("se", log_scales, q, q);
  covariance.diagonal().array() += 1e-8;
  const MatrixXd root = covariance.llt().matrixL();
  std::mt19937_64 random(32);
  MatrixXd y(count, 3);
  for (Index d = 0; d < 3; ++d) {
    VectorXd white(count);
    for (Index i = 0; i < count; ++i) white[i] = normal(&random);
    y.col(d) = signal * root * white;
    for (Index i = 0; i < count; ++i) y(i, d) += noise * normal(&random);
  }
  SearchOptions options;
  const auto found =
      search_hyperparameters(make_kernel("se"), {q, y, VectorXd::Ones(count)}, noise, options);
  ASSERT_TRUE(found.has_value());
  for (const GpHyperparameters& output : found->outputs) {
    for (Index k = 0; k < joints; ++k)
      EXPECT_NEAR(output.kernel[k], log_scales[k], 0.2) << "joint " << k;
    EXPECT_NEAR(output.log_signal_stddev, std::log(signal), 0.4);
    EXPECT_NEAR(output.log_noise_stddev, std::log(noise), 0.1);
  }
}

}  // namespace
}  // namespace trammel
