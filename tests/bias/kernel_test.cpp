#include "server/bias/kernels/kernel.h"

#include <gtest/gtest.h>

#include <numbers>

#include "server/bias/kernels/kernel_spelling.h"
#include "server/bias/process/gaussian_process.h"
#include "server/numerics/aligned_matrix.h"
#include "server/numerics/numerics.h"
#include "tests/bias/bias_data.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kJoints = 3;

// Different everywhere, so that parameters cannot be mistaken for each other.
VectorXd some_parameters(const Kernel& kernel) {
  VectorXd parameters(kernel.parameter_count(kJoints));
  for (Index p = 0; p < parameters.size(); ++p)
    parameters[p] = 0.3 - 0.11 * static_cast<double>(p % 7);
  return parameters;
}

// 150 joint vectors, some of them repeated.
MatrixXd some_joints() {
  MatrixXd q = random_joints(150, 41, kJoints);
  q.bottomRows(5) = q.topRows(5);
  return q;
}

AlignedMatrix features_of(const Kernel& kernel, const VectorXd& parameters, const MatrixXd& q) {
  AlignedMatrix table(padded_rows(q.rows()), kernel.feature_count(q.cols()));
  kernel.features(parameters, q, table.data(), table.rows());
  return table;
}

MatrixXd covariance(const Kernel& kernel, const VectorXd& parameters, const MatrixXd& q,
                    const MatrixXd& other) {
  const AlignedMatrix a = features_of(kernel, parameters, q);
  const AlignedMatrix b = features_of(kernel, parameters, other);
  AlignedMatrix k(padded_rows(q.rows()), other.rows());
  kernel.tile(parameters, {a.data(), q.rows(), a.rows()}, {b.data(), other.rows(), b.rows()},
              k.data(), k.rows());
  return k.map().topRows(q.rows());
}

KernelPtr spelled(const std::string& spelling) {
  auto kernel = spelled_kernel(spelling);
  if (!kernel) throw std::runtime_error(kernel.error().message);
  return *kernel;
}

// At `parameters` of three joints.
double entry(const std::string& spelling, const VectorXd& parameters, const VectorXd& a,
             const VectorXd& b) {
  return covariance(*spelled(spelling), parameters, a.transpose(), b.transpose())(0, 0);
}

class EverySpelling : public testing::TestWithParam<const char*> {
 protected:
  KernelPtr kernel_ = spelled(GetParam());
  VectorXd parameters_ = some_parameters(*kernel_);
  MatrixXd q_ = some_joints();
};

TEST_P(EverySpelling, IsSymmetricAndPositiveSemidefiniteWithItsDiagonal) {
  const MatrixXd k = covariance(*kernel_, parameters_, q_, q_);
  EXPECT_LT((k - k.transpose()).cwiseAbs().maxCoeff(), 1e-12 * k.cwiseAbs().maxCoeff());
  const VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<MatrixXd>(k).eigenvalues();
  EXPECT_GT(eigenvalues.minCoeff(), -1e-12 * eigenvalues.maxCoeff());
  const AlignedMatrix table = features_of(*kernel_, parameters_, q_);
  VectorXd diagonal(q_.rows());
  kernel_->diagonal(parameters_, {table.data(), q_.rows(), table.rows()}, diagonal.data());
  EXPECT_LT((diagonal - k.diagonal()).cwiseAbs().maxCoeff(), 1e-12 * k.diagonal().maxCoeff());
  EXPECT_GE(diagonal.minCoeff(), 1.0) << "a share of the prior is never asked of nothing";
}

TEST_P(EverySpelling, WeightedSumEqualsTheTileTimesTheWeights) {
  MatrixXd targets = random_joints(70, 42, kJoints);
  targets.topRows(3) = q_.topRows(3);
  AlignedMatrix weights(padded_rows(q_.rows()), 1);
  for (Index i = 0; i < q_.rows(); ++i) weights(i, 0) = std::sin(static_cast<double>(7 * i));
  const VectorXd expected = covariance(*kernel_, parameters_, q_, targets).transpose() *
                            weights.map().col(0).head(q_.rows());
  const AlignedMatrix a = features_of(*kernel_, parameters_, q_);
  const AlignedMatrix b = features_of(*kernel_, parameters_, targets);
  VectorXd sum(targets.rows());
  kernel_->weighted_sum(parameters_, {a.data(), q_.rows(), a.rows()},
                        {b.data(), targets.rows(), b.rows()}, weights.data(), sum.data());
  EXPECT_LT((sum - expected).cwiseAbs().maxCoeff(), 1e-11);
}

TEST_P(EverySpelling, GradientOfTheLikelihoodEqualsCentralDifferences) {
  GpPrior prior;
  prior.parameter_centre = VectorXd::Zero(parameters_.size());
  const BiasProblem problem = smooth_problem(q_.rows(), 43, 20e-6);
  ProfiledLikelihood likelihood(kernel_, {q_, problem.residual_B, VectorXd::Ones(q_.rows())},
                                prior);
  VectorXd at(parameters_.size() + 1);
  at << parameters_, std::log(0.05);
  ObjectiveValue here;
  ASSERT_TRUE(likelihood.evaluate(at, &here));
  for (Index p = 0; p < at.size(); ++p) {
    const auto value = [&](double offset) {
      VectorXd moved = at;
      moved[p] += offset;
      ObjectiveValue there;
      EXPECT_TRUE(likelihood.evaluate(moved, &there));
      return there.value;
    };
    const double h = 1e-4;
    const double numeric = (8 * (value(h) - value(-h)) - (value(2 * h) - value(-2 * h))) / (12 * h);
    EXPECT_NEAR(here.gradient[p], numeric, 1e-6 * here.gradient.cwiseAbs().maxCoeff())
        << "parameter " << p;
  }
}

TEST_P(EverySpelling, PredictsAsTheDenseFormulaDoesAfterGrowingToo) {
  const double signal = 2e-4;
  const double noise = 5e-5;
  const VectorXd y = smooth_problem(q_.rows(), 44).residual_B.col(0);
  const GpHyperparameters at = {parameters_, std::log(signal), std::log(noise)};
  const VectorXd shape = VectorXd::Ones(q_.rows());
  auto gp = GaussianProcess::condition(kernel_, q_.topRows(147), y.head(147), shape.head(147), at);
  ASSERT_TRUE(gp.has_value());
  gp = gp->with(q_.bottomRows(3), y.tail(3), shape.tail(3));
  ASSERT_TRUE(gp.has_value());

  MatrixXd dense = signal * signal * covariance(*kernel_, parameters_, q_, q_);
  dense.diagonal().array() += noise * noise;
  const Eigen::LLT<MatrixXd> factor(dense);
  const MatrixXd targets = random_joints(9, 45, kJoints);
  const MatrixXd cross = signal * signal * covariance(*kernel_, parameters_, q_, targets);
  const VectorXd prior =
      signal * signal * covariance(*kernel_, parameters_, targets, targets).diagonal();
  const VectorXd expected = cross.transpose() * factor.solve(y);
  VectorXd mean(targets.rows());
  gp->mean(targets, mean.data());
  const auto variance = gp->variance(targets);
  const MatrixXd solved = factor.solve(cross);
  for (Index j = 0; j < targets.rows(); ++j) {
    const PosteriorVariance& known = variance[static_cast<std::size_t>(j)];
    EXPECT_NEAR(mean[j], expected[j], 1e-11);
    EXPECT_NEAR(known.prior, prior[j], 1e-12 * prior[j]);
    EXPECT_NEAR(known.posterior, prior[j] - cross.col(j).dot(solved.col(j)), 1e-9 * prior[j]);
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, EverySpelling,
                         testing::Values("se", "matern32", "matern52", "periodic",
                                         "rational_quadratic", "linear", "white", "se(sincos)",
                                         "rational_quadratic(sincos)", "linear(sincos)",
                                         "periodic(sincos)", "white(sincos)", "matern52 + periodic",
                                         "se * linear + white", "white + white",
                                         "white * white + se", "(se + linear) * (periodic + white)",
                                         "se * matern32(sincos) * linear",
                                         "linear + (se + white) + rational_quadratic"));

TEST(Kernel, PeriodicEqualsItsFormula) {
  const Eigen::Vector3d a(0.3, -0.2, 0.9);
  const Eigen::Vector3d b(-0.4, 0.6, 0.1);
  const Eigen::Vector3d scale(0.7, 1.3, 2.0);
  const Eigen::Vector3d period(0.9, 0.5, 1.7);
  VectorXd parameters(6);
  parameters << scale.array().log(), period.array().log();
  const Eigen::Array3d sine = (std::numbers::pi * (a - b).array() / period.array()).sin();
  EXPECT_NEAR(entry("periodic", parameters, a, b),
              std::exp(-2.0 * (sine / scale.array()).square().sum()), 1e-14);
  EXPECT_NEAR(entry("periodic", parameters, a, b + 3.0 * period),
              entry("periodic", parameters, a, b), 1e-12);
}

TEST(Kernel, RationalQuadraticAndLinearEqualTheirFormulas) {
  const Eigen::Vector3d a(0.3, -0.2, 0.9);
  const Eigen::Vector3d b(-0.4, 0.6, 0.1);
  const Eigen::Vector3d scale(0.7, 1.3, 2.0);
  VectorXd parameters(4);
  parameters << scale.array().log(), std::log(1.6);
  const double half_square = 0.5 * ((a - b).array() / scale.array()).square().sum();
  EXPECT_NEAR(entry("rational_quadratic", parameters, a, b),
              std::pow(1.0 + half_square / 1.6, -1.6), 1e-14);
  const double dot = (a.array() * b.array() / scale.array().square()).sum();
  EXPECT_NEAR(entry("linear", parameters.head(3), a, b), 1.0 + dot, 1e-14);
}

TEST(Kernel, WhiteIsOneForARepeatedPoseOnly) {
  const Eigen::Vector3d q(0.3, 0.0, 0.9);
  EXPECT_EQ(entry("white", VectorXd(0), q, q), 1.0);
  EXPECT_EQ(entry("white", VectorXd(0), q, Eigen::Vector3d(0.3, -0.0, 0.9)), 1.0);
  EXPECT_EQ(entry("white", VectorXd(0), q, Eigen::Vector3d(0.9, 0.0, 0.3)), 0.0);
  EXPECT_EQ(entry("white", VectorXd(0), q, Eigen::Vector3d(0.3, 0.0, std::nextafter(0.9, 1.0))),
            0.0);
}

TEST(Kernel, OnSinesAndCosinesAWholeTurnIsNoDistance) {
  const Eigen::Vector3d q(0.3, -0.2, 0.9);
  const Eigen::Vector3d turned = q + 2.0 * std::numbers::pi * Eigen::Vector3d(1, 0, -1);
  EXPECT_NEAR(entry("se(sincos)", Eigen::Vector3d::Zero(), q, turned), 1.0, 1e-12);
  EXPECT_LT(entry("se", Eigen::Vector3d::Zero(), q, turned), 1e-9);
}

TEST(Kernel, ProductsBindBeforeSumsAndLaterPartsHaveAnAmplitude) {
  const Eigen::Vector3d a(0.3, -0.2, 0.9);
  const Eigen::Vector3d b(-0.4, 0.6, 0.1);
  const Eigen::Vector3d scale = Eigen::Vector3d(0.1, 0.2, 0.3);
  const double se = entry("se", scale, a, b);
  const double linear = entry("linear", scale, a, b);
  const double matern = entry("matern52", scale, a, b);
  const double amplitude = -0.7;
  VectorXd parameters(10);
  parameters << scale, amplitude, scale, scale;  // se; a; linear, matern52
  EXPECT_NEAR(entry("se + linear * matern52", parameters, a, b),
              se + std::exp(2 * amplitude) * linear * matern, 1e-13);
  EXPECT_NEAR(entry("(se+linear)*matern52", parameters, a, b),
              (se + std::exp(2 * amplitude) * linear) * matern, 1e-13);
}

TEST(Kernel, ALoneWordIsThatKernelItself) {
  for (const char* spelling : {"se", " se ", "(se)", "((se))"}) {
    const KernelPtr kernel = spelled(spelling);
    EXPECT_EQ(typeid(*kernel), typeid(*make_radial_kernel("se"))) << spelling;
    EXPECT_EQ(kernel->name(), "se");
  }
  EXPECT_EQ(make_kernel("sea"), nullptr);
}

TEST(Kernel, RefusesASpellingAtTheWordOrCharacterThatIsWrong) {
  const std::vector<std::pair<std::string, int>> cases = {
      {"", 1}, {"se +", 5}, {"se se", 4}, {"(se + white", 12}, {"se(tan)", 7}, {"se)", 3}};
  for (const auto& [spelling, character] : cases) {
    EXPECT_EQ(refusal_of(spelled_kernel(spelling)),
              Refusal("", {}, "bias").value(character).text(spelling))
        << spelling;
  }
  const std::vector<std::pair<std::string, std::string>> unknown_words = {{"se + gauss", "gauss"},
                                                                          {"none + se", "none"}};
  for (const auto& [spelling, word] : unknown_words) {
    const auto kernel = spelled_kernel(spelling);
    EXPECT_EQ(refusal_of(kernel), Refusal("", {}, "bias").text(word));
    for (const char* known : {"auto", "se", "matern52", "periodic", "joint_map", "parameters"}) {
      EXPECT_TRUE(kernel.error().next.find(known) != std::string::npos) << known;
    }
  }
  EXPECT_FALSE(spelled_kernel(std::string(100000, '(')).has_value());
}

TEST(Kernel, ABiasIsSpelledAsAKernelAndTheBlocksAddedToIt) {
  const auto both = spelled_bias("matern52 + joint_map + white + parameters");
  ASSERT_TRUE(both.has_value()) << both.error().message;
  EXPECT_EQ(both->blocks.size(), 2u);
  EXPECT_EQ(both->kernel->parameter_count(6), make_kernel("matern52 + white")->parameter_count(6));
  const auto plain = spelled_bias("se * (linear + white)");
  ASSERT_TRUE(plain.has_value()) << plain.error().message;
  EXPECT_TRUE(plain->blocks.empty());
  EXPECT_EQ(spelled_bias("parameters + se")->kernel->name(), "se");
  EXPECT_TRUE(check_bias_spelling("none").has_value());
}

TEST(Kernel, ABlockThatIsNotASummandOfTheWholeBiasIsRefused) {
  for (const std::string spelling :
       {"se * joint_map", "joint_map * se", "(se + parameters)", "se + joint_map(sincos)",
        "joint_map", "parameters + joint_map", "se + joint_map + joint_map"}) {
    EXPECT_EQ(refusal_of(check_bias_spelling(spelling)), Refusal("", {}, "bias").text(spelling))
        << spelling;
  }
  const std::vector<std::pair<std::string, int>> cases = {{"se + joint_map white", 16},
                                                          {"se + joint_map +", 17}};
  for (const auto& [spelling, character] : cases) {
    EXPECT_EQ(refusal_of(check_bias_spelling(spelling)),
              Refusal("", {}, "bias").value(character).text(spelling));
  }
  EXPECT_FALSE(spelled_kernel("se + joint_map").has_value()) << "a kernel has no blocks";
}

// A gear's error: 60 µm, some five periods within the range of two joints, 5 µm of noise.
BiasProblem rippled_problem(Index count, std::uint64_t seed) {
  BiasProblem problem{random_joints(count, seed, 2), MatrixXd(count, 3),
                      VectorXd::Constant(count, 5e-6)};
  std::mt19937_64 random(seed + 1000);
  for (Index i = 0; i < count; ++i) {
    const double ripple = std::sin(2.0 * std::numbers::pi * problem.q(i, 0) / 0.5) *
                          (1.0 + 0.5 * std::cos(2.0 * std::numbers::pi * problem.q(i, 1) / 0.8));
    for (int d = 0; d < 3; ++d)
      problem.residual_B(i, d) = 60e-6 * (1.0 - 0.3 * d) * ripple + 5e-6 * normal(&random);
  }
  return problem;
}

BiasModel fit(const BiasProblem& problem, const std::string& kernel, int starts = 20) {
  BiasOptions options;
  options.kernel = kernel;
  options.starts = starts;
  auto model = BiasModel::fit(problem, options);
  if (!model) throw std::runtime_error(model.error().message);
  return *std::move(model);
}

double rms_on(const BiasProblem& fresh, const BiasModel& model) {
  return std::sqrt((model.mean_all_B(fresh.q) - fresh.residual_B).cwiseAbs2().mean());
}

TEST(Kernel, PeriodicLearnsARippleFromFewerPosesThanSquaredExponential) {
  const BiasProblem few = rippled_problem(70, 51);
  const BiasProblem fresh = rippled_problem(500, 52);
  const double periodic = rms_on(fresh, fit(few, "periodic"));
  const double se = rms_on(fresh, fit(few, "se"));
  EXPECT_LT(periodic, 8e-6) << "m, 5 µm of them noise";
  EXPECT_LT(periodic, 0.5 * se);
}

TEST(Kernel, ARestoredCompositeModelPredictsTheSameBits) {
  const BiasModel model = fit(smooth_problem(260, 61), "se * linear + white", 3);
  EXPECT_EQ(model.state().kernel, "se * linear + white");
  const auto restored = BiasModel::restore(model.state());
  ASSERT_TRUE(restored.has_value());
  EXPECT_EQ(restored->state().kernel, "se * linear + white");
  const MatrixXd q = random_joints(40, 62);
  const auto from_fit = model.predict_all(q);
  const auto from_state = restored->predict_all(q);
  for (std::size_t i = 0; i < from_fit.size(); ++i) {
    EXPECT_EQ(from_fit[i].mean_B, from_state[i].mean_B);
    EXPECT_EQ(from_fit[i].stddev_B, from_state[i].stddev_B);
    EXPECT_EQ(from_fit[i].prior_share, from_state[i].prior_share);
    EXPECT_EQ(from_fit[i].mean_B, model.predict(q.row(static_cast<Index>(i))).mean_B)
        << "alone as among others";
  }
}

TEST(Kernel, ACompositeModelLearnsASmoothFunctionToTheNoise) {
  const BiasModel model = fit(smooth_problem(300, 63), "se + linear", 5);
  EXPECT_LT(model.report().leave_one_out_rms, 1.6 * std::sqrt(3.0) * 10e-6);
}

TEST(Kernel, TheCompressedVarianceOfACompositeIsTheExactOneOrClose) {
  const MatrixXd q = random_joints(400, 71, kJoints);
  const VectorXd y = smooth_problem(400, 72).residual_B.col(0);
  const MatrixXd targets = random_joints(20, 73, kJoints);
  for (const char* spelling : {"se + linear", "se * linear + white", "se(sincos) * se"}) {
    const KernelPtr kernel = spelled(spelling);
    const GpHyperparameters at = {some_parameters(*kernel), std::log(2e-4), std::log(2e-5)};
    const VectorXd shape = VectorXd::Ones(400);
    const auto compressed =
        GaussianProcess::condition(kernel, q, y, shape, at, VarianceForm::kCompressed);
    const auto exact = GaussianProcess::condition(kernel, q, y, shape, at, VarianceForm::kExact);
    ASSERT_TRUE(compressed.has_value() && exact.has_value());
    const auto few = compressed->variance(targets);
    const auto all = exact->variance(targets);
    for (std::size_t i = 0; i < few.size(); ++i)
      EXPECT_NEAR(few[i].posterior / all[i].posterior, 1.0, 0.01) << spelling;
  }
}

}  // namespace
}  // namespace trammel
