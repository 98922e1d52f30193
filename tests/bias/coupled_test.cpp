#include <gtest/gtest.h>

#include <numbers>
#include <string>

#include "server/bias/coupled/coupled_posterior.h"
#include "server/bias/coupled/coupled_search.h"
#include "tests/bias/coupled_arm.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSignal = 3e-5;        // m, of the first output; the others differ
constexpr double kCoupledNoise = 2e-5;  // m, likewise

MatrixXd turns(Index count, std::uint64_t seed) {
  return random_joints(count, seed, 3) * (std::numbers::pi / 1.2);
}

VectorXd uneven_noise(Index count) {
  VectorXd shape(count);
  for (Index i = 0; i < count; ++i) shape[i] = 0.5 + static_cast<double>(i % 4);
  return shape;
}

/// Gear errors times the Jacobian, noise of kCoupledNoise.
MatrixXd gear_residual(const MatrixXd& q, double noise, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  MatrixXd y(q.rows(), 3);
  for (Index i = 0; i < q.rows(); ++i) {
    const Vector3 error_B = arm_features(q.row(i)).by_joint.topRows(3) * gear_errors(q.row(i));
    for (Index d = 0; d < 3; ++d) y(i, d) = error_B[d] + noise * normal(&random);
  }
  return y;
}

enum class Blocks { kNone, kParameters, kJointMap, kBoth };

LinearBlocks made(Blocks which) {
  std::vector<LinearBlockPtr> blocks;
  if (which == Blocks::kJointMap || which == Blocks::kBoth)
    blocks.push_back(make_joint_map_block());
  if (which == Blocks::kParameters || which == Blocks::kBoth)
    blocks.push_back(make_parameter_block());
  return arm_blocks(std::move(blocks));
}

CoupledHyperparameters some_hyperparameters(const LinearBlocks& blocks) {
  CoupledHyperparameters at;
  for (int d = 0; d < 3; ++d) {
    const VectorXd scales = Eigen::Vector3d(0.1 + 0.1 * d, 0.3 - 0.1 * d, 0.2);
    at.outputs.push_back({scales, std::log(kSignal) + 0.3 * d, std::log(kCoupledNoise) - 0.2 * d});
  }
  at.blocks = blocks.start();
  for (Index k = 0; k < at.blocks.size(); ++k)
    at.blocks[k] += 0.2 * static_cast<double>(k % 3) - 0.1;
  return at;
}

double squared_exponential(const VectorXd& log_scales, const VectorXd& a, const VectorXd& b) {
  return std::exp(-0.5 * ((a - b).array() * (-log_scales.array()).exp()).square().sum());
}

/// Σ_h s_h cos(h (a - b)) / Σ_h s_h, s_h = (1 + (h/knee)²)⁻², 48 harmonics: the joint map's kernel,
/// by its definition.
double on_the_circle(double knee, double a, double b) {
  double sum = 0;
  double total = 0;
  for (int h = 0; h <= 48; ++h) {
    const double density = std::pow(1 + h * h / (knee * knee), -2);
    sum += density * std::cos(h * (a - b));
    total += density;
  }
  return sum / total;
}

/// 3 x 3 covariance of the functions at two joint vectors, by their kernels and no weights.
Matrix3 reference_covariance(Blocks which, const CoupledHyperparameters& at, const VectorXd& a,
                             const VectorXd& b) {
  Matrix3 covariance = Matrix3::Zero();
  for (Index d = 0; d < 3; ++d) {
    const GpHyperparameters& output = at.outputs[static_cast<std::size_t>(d)];
    covariance(d, d) =
        std::exp(2 * output.log_signal_stddev) * squared_exponential(output.kernel, a, b);
  }
  const BiasFeatures at_a = arm_features(a);
  const BiasFeatures at_b = arm_features(b);
  for (Index j = 0; j < 3 && (which == Blocks::kJointMap || which == Blocks::kBoth); ++j) {
    const double k =
        std::exp(2 * at.blocks[2 * j]) * on_the_circle(std::exp(at.blocks[2 * j + 1]), a[j], b[j]);
    covariance += k * at_a.by_joint.col(j).head(3) * at_b.by_joint.col(j).head(3).transpose();
  }
  if (which == Blocks::kParameters || which == Blocks::kBoth)
    covariance += at_a.by_parameter.topRows(3) * at_b.by_parameter.topRows(3).transpose();
  return covariance;
}

/// The whole 3N x 3N covariance, pose after pose, and what follows from it.
class Dense {
 public:
  Dense(Blocks which, const CoupledData& data, const CoupledHyperparameters& at)
      : which_(which), at_(at), q_(data.q) {
    const Index n = data.q.rows();
    MatrixXd covariance(3 * n, 3 * n);
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j)
        covariance.block(3 * i, 3 * j, 3, 3) =
            reference_covariance(which, at, q_.row(i), q_.row(j));
      for (Index d = 0; d < 3; ++d)
        covariance(3 * i + d, 3 * i + d) += noise(d) * data.noise_shape[i];
    }
    factor_.compute(covariance);
    const MatrixXd transposed = data.y.transpose();
    const VectorXd y = transposed.reshaped();
    alpha_ = factor_.solve(y);
    const double log_det = 2 * MatrixXd(factor_.matrixL()).diagonal().array().log().sum();
    log_likelihood_ = -0.5 * (y.dot(alpha_) + log_det +
                              static_cast<double>(3 * n) * std::log(2 * std::numbers::pi));
  }

  double log_likelihood() const { return log_likelihood_; }
  double noise(Index d) const {
    return std::exp(2 * at_.outputs[static_cast<std::size_t>(d)].log_noise_stddev);
  }
  Vector3 mean(const VectorXd& q) const { return cross(q).transpose() * alpha_; }
  Matrix3 prior(const VectorXd& q) const { return reference_covariance(which_, at_, q, q); }
  Matrix3 covariance(const VectorXd& q) const {
    const MatrixXd k = cross(q);
    return prior(q) - k.transpose() * factor_.solve(k);
  }

 private:
  MatrixXd cross(const VectorXd& q) const {
    MatrixXd k(3 * q_.rows(), 3);
    for (Index i = 0; i < q_.rows(); ++i)
      k.middleRows(3 * i, 3) = reference_covariance(which_, at_, q_.row(i), q);
    return k;
  }

  Blocks which_;
  CoupledHyperparameters at_;
  MatrixXd q_;
  Eigen::LLT<MatrixXd> factor_;
  VectorXd alpha_;
  double log_likelihood_ = 0;
};

struct Case {
  std::string name;
  Blocks which;
  Index count;
};

class EveryBlock : public testing::TestWithParam<Case> {
 protected:
  LinearBlocks blocks() const { return made(GetParam().which); }
  CoupledData data() const {
    const MatrixXd q = turns(GetParam().count, 41);
    return arm_data(blocks(), q, gear_residual(q, kCoupledNoise, 42), uneven_noise(q.rows()));
  }
};

TEST_P(EveryBlock, LikelihoodEqualsTheDenseFormula) {
  const LinearBlocks blocks = this->blocks();
  const CoupledData data = this->data();
  const CoupledHyperparameters at = some_hyperparameters(blocks);
  const auto solution = solve(*make_kernel("se"), blocks, data, at);
  ASSERT_TRUE(solution.has_value());
  const double expected = Dense(GetParam().which, data, at).log_likelihood();
  EXPECT_NEAR(solution->log_likelihood, expected, 1e-9 * std::abs(expected));
}

TEST_P(EveryBlock, MeanAndJointCovarianceOfTheAxesEqualTheDenseFormula) {
  const LinearBlocks blocks = this->blocks();
  const CoupledData data = this->data();
  const CoupledHyperparameters at = some_hyperparameters(blocks);
  const auto posterior =
      CoupledPosterior::condition(make_kernel("se"), blocks, data, at, VarianceForm::kExact);
  ASSERT_TRUE(posterior.has_value());
  const Dense dense(GetParam().which, data, at);
  EXPECT_NEAR(posterior->log_likelihood(), dense.log_likelihood(),
              1e-9 * std::abs(dense.log_likelihood()));
  const MatrixXd targets = turns(9, 43);
  for (Index i = 0; i < targets.rows(); ++i) {
    const JointVector q = targets.row(i);
    const CoupledPrediction found = predict_one(*posterior, q, arm_columns(blocks, q));
    const Matrix3 prior = dense.prior(q);
    const double scale = prior.trace();
    EXPECT_LT((found.mean - dense.mean(q)).norm(), 1e-9 * std::sqrt(scale));
    EXPECT_LT((found.covariance - dense.covariance(q)).norm(), 1e-9 * scale);
    EXPECT_LT((found.prior - prior.diagonal()).norm(), 1e-12 * scale);
  }
}

TEST_P(EveryBlock, LeavingAPoseOutEqualsFittingWithoutIt) {
  const LinearBlocks blocks = this->blocks();
  const CoupledData data = this->data();
  const CoupledHyperparameters at = some_hyperparameters(blocks);
  const auto posterior = CoupledPosterior::condition(make_kernel("se"), blocks, data, at);
  ASSERT_TRUE(posterior.has_value());
  for (const Index out : {Index{0}, GetParam().count / 2, GetParam().count - 1}) {
    std::vector<Index> kept;
    for (Index i = 0; i < GetParam().count; ++i) {
      if (i != out) kept.push_back(i);
    }
    const CoupledData rest = arm_data(blocks, data.q(kept, Eigen::all), data.y(kept, Eigen::all),
                                      data.noise_shape(kept));
    const auto without =
        CoupledPosterior::condition(make_kernel("se"), blocks, rest, at, VarianceForm::kExact);
    ASSERT_TRUE(without.has_value());
    const JointVector q = data.q.row(out);
    const CoupledPrediction expected = predict_one(*without, q, arm_columns(blocks, q));
    for (Index d = 0; d < 3; ++d) {
      const double noise = std::exp(2 * at.outputs[static_cast<std::size_t>(d)].log_noise_stddev);
      const double variance = expected.covariance(d, d) + noise * data.noise_shape[out];
      EXPECT_NEAR(posterior->leave_one_out_mean()(out, d), expected.mean[d],
                  1e-8 * std::sqrt(variance));
      EXPECT_NEAR(posterior->leave_one_out_variance()(out, d), variance, 1e-8 * variance);
    }
  }
}

TEST_P(EveryBlock, CrossValidationSurprisesAsFittingWithoutARunOfPosesSays) {
  const LinearBlocks blocks = this->blocks();
  const CoupledData data = this->data();
  const CoupledHyperparameters at = some_hyperparameters(blocks);
  const auto posterior = CoupledPosterior::condition(make_kernel("se"), blocks, data, at);
  ASSERT_TRUE(posterior.has_value());
  double surprise = 0;
  for (Index fold = 0; fold < 3; ++fold) {
    const auto is_out = [fold](Index i) { return i / 10 % 3 == fold; };
    std::vector<Index> kept;
    for (Index i = 0; i < GetParam().count; ++i) {
      if (!is_out(i)) kept.push_back(i);
    }
    const CoupledData rest = arm_data(blocks, data.q(kept, Eigen::all), data.y(kept, Eigen::all),
                                      data.noise_shape(kept));
    const auto without =
        CoupledPosterior::condition(make_kernel("se"), blocks, rest, at, VarianceForm::kExact);
    ASSERT_TRUE(without.has_value());
    for (Index i = 0; i < GetParam().count; ++i) {
      if (!is_out(i)) continue;
      const JointVector q = data.q.row(i);
      const CoupledPrediction expected = predict_one(*without, q, arm_columns(blocks, q));
      for (Index d = 0; d < 3; ++d) {
        const double noise = std::exp(2 * at.outputs[static_cast<std::size_t>(d)].log_noise_stddev);
        surprise += std::pow(data.y(i, d) - expected.mean[d], 2) /
                    (expected.covariance(d, d) + noise * data.noise_shape[i]);
      }
    }
  }
  surprise /= static_cast<double>(3 * GetParam().count);
  EXPECT_NEAR(posterior->surprise(), surprise, 1e-6 * surprise);
}

void expect_gradient_of_differences(const CoupledLikelihood& likelihood, const VectorXd& x) {
  ObjectiveValue evaluation;
  ASSERT_TRUE(likelihood.evaluate(x, &evaluation));
  const double scale = evaluation.gradient.cwiseAbs().maxCoeff();
  for (Index p = 0; p < x.size(); ++p) {
    const double h = 1e-3;
    const auto at = [&](double offset) {
      VectorXd moved = x;
      moved[p] += offset;
      ObjectiveValue there;
      EXPECT_TRUE(likelihood.evaluate(moved, &there));
      return there.value;
    };
    const double numeric = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
    EXPECT_NEAR(evaluation.gradient[p], numeric, 1e-7 * scale) << "hyperparameter " << p;
  }
}

TEST_P(EveryBlock, GradientEqualsCentralDifferences) {
  const LinearBlocks blocks = this->blocks();
  CoupledPrior prior;  // that all pull
  prior.noise_stddev = VectorXd::Constant(3, 3 * kCoupledNoise);
  prior.noise_spread = 0.5;
  prior.parameter_centre = Eigen::Vector3d(1.0, 0.5, -0.5);
  prior.signal_centre = VectorXd::Constant(3, std::log(1e-4));
  for (const bool shared : {true, false}) {
    prior.shared_scales = shared;
    const CoupledLikelihood likelihood(make_kernel("se"), blocks, data(), prior);
    const VectorXd x = likelihood.pack(some_hyperparameters(blocks));
    ASSERT_EQ(x.size(), (shared ? 3 : 9) + 6 + blocks.parameter_count());
    expect_gradient_of_differences(likelihood, x);
  }
}

// Sizes on both sides of the tiles.
INSTANTIATE_TEST_SUITE_P(Kinds, EveryBlock,
                         testing::Values(Case{"none_30", Blocks::kNone, 30},
                                         Case{"parameters_64", Blocks::kParameters, 64},
                                         Case{"joint_map_41", Blocks::kJointMap, 41},
                                         Case{"both_97", Blocks::kBoth, 97}),
                         [](const auto& test) { return test.param.name; });

TEST(CoupledPosterior, PassesOverPosesThatAreTooFarAwayToMatterAndNoOthers) {
  const LinearBlocks blocks = made(Blocks::kBoth);
  const MatrixXd q = turns(220, 53);
  CoupledHyperparameters at = some_hyperparameters(blocks);
  for (GpHyperparameters& output : at.outputs) {
    output.kernel.array() += std::log(0.1);
    output.log_signal_stddev = std::log(5 * kSignal);
  }
  const CoupledData data =
      arm_data(blocks, q, gear_residual(q, kCoupledNoise, 54), uneven_noise(q.rows()));
  const auto fast = CoupledPosterior::condition(make_kernel("matern52"), blocks, data, at);
  const auto exact =
      CoupledPosterior::condition(make_kernel("matern52"), blocks, data, at, VarianceForm::kExact);
  ASSERT_TRUE(fast && exact);
  double moved = 0;
  const MatrixXd targets = turns(30, 55) * 0.5;
  for (const auto& target : targets.rowwise()) {
    const MatrixXd H = arm_columns(blocks, target);
    const CoupledPrediction a = predict_one(*fast, target, H);
    const CoupledPrediction b = predict_one(*exact, target, H);
    EXPECT_EQ(a.mean, b.mean);
    for (Index d = 0; d < 3; ++d) {
      const double noise =
          0.5 * std::exp(2 * at.outputs[static_cast<std::size_t>(d)].log_noise_stddev);
      EXPECT_NEAR(a.covariance(d, d), b.covariance(d, d), 0.003 * noise);
      moved = std::max(moved, std::abs(a.covariance(d, d) - b.covariance(d, d)) / noise);
    }
  }
  EXPECT_GT(moved, 1e-9) << "nothing was passed over";
}

/// Poses whose own signal is below the noise, as calibration leaves it, or far above.
struct ServedCase {
  LinearBlocks blocks = made(Blocks::kBoth);
  MatrixXd q = turns(400, 71);
  CoupledHyperparameters at = some_hyperparameters(blocks);
  CoupledData data =
      arm_data(blocks, q, gear_residual(q, kCoupledNoise, 72), uneven_noise(q.rows()));

  explicit ServedCase(double signal_over_noise) {
    for (GpHyperparameters& output : at.outputs)
      output.log_signal_stddev = output.log_noise_stddev + std::log(signal_over_noise);
  }
  CoupledPosterior posterior(VarianceForm form) const {
    return *CoupledPosterior::condition(make_kernel("matern52"), blocks, data, at, form);
  }
};

TEST(CoupledPosterior, ServesFromNearPosesWhatAllSay) {
  for (const double signal_over_noise : {0.1, 0.5, 5.0}) {
    const ServedCase served(signal_over_noise);
    const CoupledPosterior near = served.posterior(VarianceForm::kServed);
    const CoupledPosterior all = served.posterior(VarianceForm::kExact);
    const MatrixXd targets = turns(150, 73);  // not those that it was tried at
    for (const auto& target : targets.rowwise()) {
      const MatrixXd H = arm_columns(served.blocks, target);
      const CoupledPrediction a = predict_one(near, target, H);
      const CoupledPrediction b = predict_one(all, target, H);
      EXPECT_EQ(a.mean, b.mean);
      for (Index d = 0; d < 3; ++d) {
        const double noise =
            std::exp(2 * served.at.outputs[static_cast<std::size_t>(d)].log_noise_stddev);
        const double measured = b.covariance(d, d) + noise;
        EXPECT_GE(a.covariance(d, d), b.covariance(d, d) - 0.01 * measured) << signal_over_noise;
        EXPECT_LE(a.covariance(d, d), b.covariance(d, d) + 0.05 * measured) << signal_over_noise;
      }
    }
  }
}

TEST(CoupledPosterior, NearPosesTakeFromTheColumnsWhatAllTakeOfThem) {
  struct Limit {
    double signal_over_noise,
        share;  // of the functions' own variance, far below that of a measurement
  };
  for (const Limit& limit : {Limit{0.1, 0.04}, Limit{0.3, 0.1}}) {
    const ServedCase served(limit.signal_over_noise);
    const CoupledPosterior near = served.posterior(VarianceForm::kServed);
    const CoupledPosterior all = served.posterior(VarianceForm::kExact);
    ASSERT_EQ(near.outputs_from_near_points(), 3) << limit.signal_over_noise;
    const MatrixXd targets = turns(150, 74);
    for (const auto& target : targets.rowwise()) {
      const MatrixXd H = arm_columns(served.blocks, target);
      const Eigen::Array3d a = predict_one(near, target, H).covariance.diagonal();
      const Eigen::Array3d b = predict_one(all, target, H).covariance.diagonal();
      EXPECT_LT(((a - b) / b).abs().maxCoeff(), limit.share) << limit.signal_over_noise;
    }
  }
}

TEST(CoupledPosterior, TakesNearPosesWhereTheyAreEnoughAndOnlyThere) {
  EXPECT_EQ(ServedCase(0.1).posterior(VarianceForm::kServed).outputs_from_near_points(), 3);
  EXPECT_EQ(ServedCase(5.0).posterior(VarianceForm::kServed).outputs_from_near_points(), 0);
  EXPECT_EQ(ServedCase(0.1).posterior(VarianceForm::kExact).outputs_from_near_points(), 0);
}

TEST(CoupledPosterior, SaysThatAnErrorOfTheFirstJointIsAcrossTheArmAndNotAlongIt) {
  const LinearBlocks blocks = made(Blocks::kJointMap);
  const MatrixXd q = turns(40, 51);
  CoupledHyperparameters at = some_hyperparameters(blocks);
  for (GpHyperparameters& output : at.outputs) output.log_signal_stddev = std::log(1e-7);
  at.blocks[2] = at.blocks[4] = std::log(1e-8);  // the other two joints are true
  const auto posterior = CoupledPosterior::condition(
      make_kernel("se"), blocks,
      arm_data(blocks, q, gear_residual(q, kCoupledNoise, 52), VectorXd::Ones(40)), at);
  ASSERT_TRUE(posterior.has_value());
  const JointVector target = Eigen::Vector3d(0.7, 0.4, -0.9);
  const Matrix3 covariance =
      predict_one(*posterior, target, arm_columns(blocks, target)).covariance;
  const Vector3 along_B(std::cos(target[0]), std::sin(target[0]), 0);
  const Vector3 across_B = Vector3::UnitZ().cross(along_B);
  EXPECT_LT(std::sqrt(along_B.dot(covariance * along_B)), 2e-7);
  EXPECT_GT(std::sqrt(across_B.dot(covariance * across_B)), 2e-6);
}

struct MapTask {
  LinearBlocks blocks = made(Blocks::kJointMap);
  double noise = 5e-6;
  MatrixXd q = turns(150, 61);
  MatrixXd y = gear_residual(q, noise, 62);
  MatrixXd targets = turns(200, 63);
  MatrixXd truth = gear_residual(targets, 0, 64);
  CoupledData data = arm_data(blocks, q, y, VectorXd::Ones(150));
};

SearchOptions starting(int starts) {
  SearchOptions options;
  options.starts = starts;
  return options;
}

double plain_error(const MapTask& task) {
  const MatrixXd centred = task.y.rowwise() - task.y.colwise().mean();
  const auto found = search_hyperparameters(
      make_kernel("se"), {task.q, centred, VectorXd::Ones(150)}, task.noise, starting(10));
  MatrixXd error = (-task.truth).rowwise() + task.y.colwise().mean();
  for (Index d = 0; d < 3; ++d) {
    const auto process =
        GaussianProcess::condition(make_kernel("se"), task.q, centred.col(d), VectorXd::Ones(150),
                                   found->outputs[static_cast<std::size_t>(d)]);
    VectorXd mean(task.targets.rows());
    process->mean(task.targets, mean.data());
    error.col(d) += mean;
  }
  return std::sqrt(error.rowwise().squaredNorm().mean());
}

std::optional<CoupledSearchResult> coupled_search(const MapTask& task, bool shared_scales = true) {
  return search_coupled(make_kernel("se"), {task.blocks, task.data}, {task.blocks, task.data},
                        VectorXd::Constant(3, task.noise), shared_scales, starting(2));
}

TEST(CoupledSearch, LearnsGearErrorsThatAPlainProcessCannot) {
  const MapTask task;
  const auto found = coupled_search(task);
  ASSERT_TRUE(found.has_value());
  const auto posterior =
      CoupledPosterior::condition(make_kernel("se"), task.blocks, task.data, found->found);
  ASSERT_TRUE(posterior.has_value());
  double total = 0;
  double normalised = 0;
  for (Index i = 0; i < task.targets.rows(); ++i) {
    const JointVector q = task.targets.row(i);
    const CoupledPrediction at = predict_one(*posterior, q, arm_columns(task.blocks, q));
    const VectorXd error = at.mean - task.truth.row(i).transpose();
    total += error.squaredNorm();
    normalised += error.dot(at.covariance.llt().solve(error)) / 3;
  }
  const double rms = std::sqrt(total / static_cast<double>(task.targets.rows()));
  const double plain = plain_error(task);
  const double doing_nothing = std::sqrt(task.truth.rowwise().squaredNorm().mean());
  RecordProperty("coupled_um", std::to_string(rms * 1e6));
  RecordProperty("plain_um", std::to_string(plain * 1e6));
  RecordProperty("normalised", std::to_string(normalised / 200));
  EXPECT_LT(rms, 0.15 * doing_nothing);
  EXPECT_GT(plain, 0.6 * doing_nothing);
  EXPECT_NEAR(normalised / static_cast<double>(task.targets.rows()), 1.0, 0.5);
}

TEST(CoupledSearch, FindsEachJointsOwnMap) {
  const MapTask task;
  const auto found = coupled_search(task);
  ASSERT_TRUE(found.has_value());
  const auto posterior =
      CoupledPosterior::condition(make_kernel("se"), task.blocks, task.data, found->found);
  ASSERT_TRUE(posterior.has_value());
  const Index each = task.blocks.column_count() / 3;
  for (Index j = 0; j < 3; ++j) {
    double total = 0;
    for (int step = 0; step < 100; ++step) {
      const double angle = -3.1 + 0.062 * step;
      double map = posterior->weights()[each * j];
      for (Index h = 1; 2 * h < each; ++h) {
        const double turned = static_cast<double>(h) * angle;
        map += posterior->weights()[each * j + 2 * h - 1] * std::cos(turned) +
               posterior->weights()[each * j + 2 * h] * std::sin(turned);
      }
      total += std::pow(map - gear_errors(VectorXd::Constant(3, angle))[j], 2);
    }
    EXPECT_LT(std::sqrt(total / 100), 2e-5) << "rad, joint " << j;
  }
}

TEST(CoupledSearch, GivesTheSameModelBitForBitFromTheSameSeed) {
  const MapTask task;
  const auto first = coupled_search(task, false);
  const auto second = coupled_search(task, false);
  ASSERT_TRUE(first.has_value() && second.has_value());
  EXPECT_EQ(first->found.blocks, second->found.blocks);
  for (std::size_t d = 0; d < 3; ++d) {
    EXPECT_EQ(first->found.outputs[d].kernel, second->found.outputs[d].kernel);
    EXPECT_EQ(first->found.outputs[d].log_noise_stddev, second->found.outputs[d].log_noise_stddev);
  }
  const JointVector q = task.targets.row(0);
  const MatrixXd columns = arm_columns(task.blocks, q);
  const auto before =
      CoupledPosterior::condition(make_kernel("se"), task.blocks, task.data, first->found);
  const auto restored =
      CoupledPosterior::condition(make_kernel("se"), task.blocks, task.data, second->found);
  EXPECT_EQ(predict_one(*before, q, columns).mean, predict_one(*restored, q, columns).mean);
  EXPECT_EQ(predict_one(*before, q, columns).covariance,
            predict_one(*restored, q, columns).covariance);
}

TEST(CoupledSearch, StopsWhenTold) {
  const MapTask task;
  SearchOptions options;
  options.progress = [](double) { return false; };
  const auto found =
      search_coupled(make_kernel("se"), {task.blocks, task.data}, {task.blocks, task.data},
                     VectorXd::Constant(3, task.noise), true, options);
  ASSERT_TRUE(found.has_value());
  EXPECT_TRUE(found->given_up);
}

}  // namespace
}  // namespace trammel
