#include <gtest/gtest.h>

#include <numbers>

#include "server/bias/choose_bias.h"
#include "server/bias/flange/flange_likelihood.h"
#include "server/bias/flange/flange_search.h"
#include "tests/bias/flange_arm.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const Vector3 kA(0.1, 0.0, 0.2);
const Vector3 kB(-0.05, 0.09, 0.2);
const Vector3 kC(-0.05, -0.09, 0.25);
const Vector3 kNew(0.08, -0.12, 0.35);

BiasModel fit_flange(const BiasProblem& problem, const std::string& kernel) {
  BiasOptions options;
  options.kernel = kernel;
  options.starts = 4;
  auto model = BiasModel::fit(problem, options);
  if (!model) throw std::runtime_error(model.error().message);
  return *std::move(model);
}

/// Rows with one, two and three levers, of different noise.
BiasProblem mixed_problem() {
  const MatrixXd q = random_joints(9, 3);
  BiasProblem problem = seen_problem(q, {kA, kB, kC}, 3);
  std::vector<Index> kept;
  for (Index i = 0; i < problem.q.rows(); ++i) {
    if (i % 3 <= (i / 3) % 3) kept.push_back(i);
  }
  BiasProblem some{
      problem.q(kept, Eigen::all), problem.residual_B(kept, Eigen::all), problem.sigma(kept), {}};
  for (const Index i : kept) some.features.push_back(problem.features[static_cast<std::size_t>(i)]);
  for (Index i = 0; i < some.sigma.size(); ++i)
    some.sigma[i] *= 1 + 0.1 * static_cast<double>(i % 4);
  return some;
}

BiasState state_of(const BiasProblem& problem) {
  BiasState state{"se + flange", problem.q,         problem.residual_B,
                  problem.sigma, VectorXd::Zero(3), MatrixXd(8, 3)};
  for (Index d = 0; d < 3; ++d) {
    for (Index j = 0; j < 6; ++j)
      state.hyperparameters(j, d) = 0.2 + 0.05 * static_cast<double>(d + j);
    state.hyperparameters(6, d) = std::log(2e-4) + 0.1 * static_cast<double>(d);
    state.hyperparameters(7, d) = std::log(1.5e-5);
  }
  state.offset = Vector3(1e-5, -2e-5, 3e-5);
  state.block_hyperparameters = VectorXd::Constant(7, 0.4);
  state.block_hyperparameters[6] = std::log(3e-4);
  state.features = problem.features;
  return state;
}

/// The posterior by the book: all rows, three coordinates each, no reduction, no shared code.
class Plain {
 public:
  explicit Plain(const BiasState& state) : state_(state), n_(state.q.rows()) {
    for (const BiasFeatures& one : state.features)
      reference_F_ += one.lever_F / static_cast<double>(n_);
    std::vector<double> sigma(state.sigma.data(), state.sigma.data() + n_);
    std::nth_element(sigma.begin(), sigma.begin() + n_ / 2, sigma.end());
    noise_ = MatrixXd::Zero(3 * n_, 3 * n_);
    y_.resize(3 * n_);
    for (Index i = 0; i < n_; ++i) {
      const double ratio = state.sigma[i] / sigma[static_cast<std::size_t>(n_ / 2)];
      noise_.block<3, 3>(3 * i, 3 * i) =
          Matrix3::Identity() * std::exp(2 * state.hyperparameters(7, 0)) * ratio * ratio;
      y_.segment<3>(3 * i) = state.residual_B.row(i).transpose() - state.offset;
    }
    K_.resize(3 * n_, 3 * n_);
    for (Index i = 0; i < n_; ++i) {
      for (Index j = 0; j < n_; ++j)
        K_.block<3, 3>(3 * i, 3 * j) = covariance(row(i), at(i), row(j), at(j));
    }
  }

  Matrix3 covariance(const JointVector& a, const BiasFeatures& of_a, const JointVector& b,
                     const BiasFeatures& of_b) const {
    const auto se = [&](const VectorXd& scales) {
      return std::exp(-0.5 * ((a - b).array() / scales.array().exp()).square().sum());
    };
    Matrix3 k = Matrix3::Zero();
    for (Index d = 0; d < 3; ++d)
      k(d, d) =
          std::exp(2 * state_.hyperparameters(6, d)) * se(state_.hyperparameters.col(d).head(6));
    const double turn =
        std::exp(2 * state_.block_hyperparameters[6]) * se(state_.block_hyperparameters.head(6));
    return k + turn * skew(arm(of_a)) * skew(arm(of_b)).transpose();
  }

  double log_likelihood() const {
    const Eigen::LLT<MatrixXd> root(K_ + noise_);
    return -0.5 * (y_.dot(root.solve(y_)) + 2 * root.matrixLLT().diagonal().array().log().sum() +
                   static_cast<double>(3 * n_) * std::log(2 * std::numbers::pi));
  }

  struct At {
    VectorXd mean;  // offset included
    MatrixXd covariance;
  };
  /// The prediction of the function at a pose, from these rows.
  At predict(const JointVector& q, const BiasFeatures& features,
             const std::vector<Index>& from) const {
    const auto m = static_cast<Index>(from.size());
    MatrixXd cross(3 * m, 3);
    std::vector<Index> numbers;
    for (Index i = 0; i < m; ++i) {
      const Index known = from[static_cast<std::size_t>(i)];
      cross.middleRows<3>(3 * i) = covariance(row(known), at(known), q, features);
      for (Index d = 0; d < 3; ++d) numbers.push_back(3 * known + d);
    }
    const MatrixXd C = (K_ + noise_)(numbers, numbers);
    const Eigen::LLT<MatrixXd> root(C);
    return {cross.transpose() * root.solve(VectorXd(y_(numbers))) + state_.offset,
            covariance(q, features, q, features) - cross.transpose() * root.solve(cross)};
  }
  At predict_row(Index i, const std::vector<Index>& from) const {
    return predict(row(i), at(i), from);
  }
  Matrix3 noise_of(Index i) const { return noise_.block<3, 3>(3 * i, 3 * i); }
  std::vector<Index> all_but(const std::vector<Index>& rows) const {
    std::vector<Index> rest;
    for (Index i = 0; i < n_; ++i) {
      if (std::find(rows.begin(), rows.end(), i) == rows.end()) rest.push_back(i);
    }
    return rest;
  }
  std::vector<Index> same_joints(Index i) const {
    std::vector<Index> same;
    for (Index j = 0; j < n_; ++j) {
      if (state_.q.row(j) == state_.q.row(i)) same.push_back(j);
    }
    return same;
  }

 private:
  JointVector row(Index i) const { return state_.q.row(i).transpose(); }
  const BiasFeatures& at(Index i) const { return state_.features[static_cast<std::size_t>(i)]; }
  Vector3 arm(const BiasFeatures& features) const {
    return features.R_BF * (features.lever_F - reference_F_);
  }

  const BiasState& state_;
  Index n_;
  Vector3 reference_F_ = Vector3::Zero();
  MatrixXd noise_, K_;
  VectorXd y_;
};

TEST(Flange, IsTheGaussianProcessOfAllItsRowsByTheBook) {
  const BiasProblem problem = mixed_problem();
  const BiasState state = state_of(problem);
  const auto model = BiasModel::restore(state);
  ASSERT_TRUE(model.has_value()) << model.error().message;
  const Plain plain(state);
  EXPECT_NEAR(model->report().log_likelihood[0], plain.log_likelihood(),
              1e-7 * std::abs(plain.log_likelihood()));
  const MatrixXd targets = random_joints(5, 77);
  for (Index i = 0; i < targets.rows(); ++i) {
    const BiasFeatures features = at_lever(targets.row(i), kNew);
    const BiasPrediction at = model->predict(targets.row(i), features);
    const Plain::At expected = plain.predict(targets.row(i), features, plain.all_but({}));
    EXPECT_LT((at.mean_B - expected.mean).norm(), 1e-11);
    EXPECT_LT((at.covariance_B - expected.covariance).norm(), 1e-7 * expected.covariance.norm());
    EXPECT_EQ(at.mean_B, model->mean_B(targets.row(i), features));
  }
}

TEST(Flange, LeavesAllRowsOfAJointVectorOutAsIfTheyHadNeverBeenMeasured) {
  const BiasProblem problem = mixed_problem();
  const BiasState state = state_of(problem);
  const auto model = BiasModel::restore(state);
  ASSERT_TRUE(model.has_value()) << model.error().message;
  const Plain plain(state);
  const MatrixXd mean = model->leave_one_out_mean_B();
  const MatrixXd stddev = model->leave_one_out_stddev_B();
  const VectorXd share = model->leave_one_out_prior_share();
  for (Index i = 0; i < problem.q.rows(); ++i) {
    const Plain::At at = plain.predict_row(i, plain.all_but(plain.same_joints(i)));
    EXPECT_LT((mean.row(i).transpose() - at.mean).norm(), 1e-10) << i;
    const Vector3 measured = (at.covariance + plain.noise_of(i)).diagonal().cwiseSqrt();
    EXPECT_LT((stddev.row(i).transpose() - measured).norm(), 1e-6 * measured.norm()) << i;
    const Plain::At unknown = plain.predict_row(i, {});
    EXPECT_NEAR(share[i],
                at.covariance.diagonal().cwiseQuotient(unknown.covariance.diagonal()).maxCoeff(),
                1e-6);
  }
}

TEST(Flange, LeavesWholeJointVectorsOutOfABlock) {
  const BiasProblem problem = mixed_problem();
  const BiasState state = state_of(problem);
  const auto model = BiasModel::restore(state);
  ASSERT_TRUE(model.has_value()) << model.error().message;
  const Plain plain(state);
  const std::vector<Index> block = {2, 4, 5, 9};
  std::vector<Index> gone;
  for (const Index i : block) {
    for (const Index same : plain.same_joints(i)) gone.push_back(same);
  }
  const auto error = model->left_out_error_B(problem.residual_B, block);
  ASSERT_TRUE(error.has_value());
  for (std::size_t k = 0; k < block.size(); ++k) {
    const Plain::At at = plain.predict_row(block[k], plain.all_but(gone));
    const Vector3 missed = problem.residual_B.row(block[k]).transpose() - at.mean;
    EXPECT_LT((error->row(static_cast<Index>(k)).transpose() - missed).norm(), 1e-10) << k;
  }
}

TEST(Flange, TheGradientOfItsLikelihoodIsThatOfDifferences) {
  const BiasProblem problem = mixed_problem();
  const FlangeViews views = views_of(problem.q, VectorXd::Ones(problem.q.rows()), problem.features);
  const KernelPtr kernel = make_kernel("se + matern32");
  const Index count = kernel->parameter_count(6);
  FlangePrior prior;
  prior.noise_stddev = 2e-5;
  prior.parameter_centre = VectorXd::Constant(count, 0.5);
  prior.rotation_centre = VectorXd::Constant(count + 1, -1.0);
  prior.signal_centre = -9;
  const FlangeLikelihood likelihood(kernel, views, numbers_of(views, problem.residual_B), prior);
  VectorXd x(4 * count + 5);
  for (Index k = 0; k < x.size(); ++k) x[k] = 0.3 + 0.02 * static_cast<double>(k % 7);
  x.segment(3 * count, 3).setConstant(std::log(2e-4));
  x[3 * count + 3] = std::log(1.5e-5);
  x[4 * count + 4] = std::log(3e-4);
  EXPECT_EQ(likelihood.pack(likelihood.unpack(x)), x);
  ObjectiveValue at, more, less;
  ASSERT_TRUE(likelihood.evaluate(x, &at));
  for (Index k = 0; k < x.size(); ++k) {
    const double step = 1e-5;
    VectorXd moved = x;
    moved[k] += step;
    ASSERT_TRUE(likelihood.evaluate(moved, &more));
    moved[k] -= 2 * step;
    ASSERT_TRUE(likelihood.evaluate(moved, &less));
    EXPECT_NEAR(at.gradient[k], (more.value - less.value) / (2 * step),
                1e-4 * (1 + std::abs(at.gradient[k])))
        << k;
  }
}

double rms_at(const BiasModel& model, const MatrixXd& q, const Vector3& lever_F) {
  double squares = 0;
  for (Index i = 0; i < q.rows(); ++i) {
    const JointVector at = q.row(i);
    squares +=
        (model.mean_B(at, at_lever(at, lever_F)) - error_at_lever_B(at, lever_F)).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(q.rows()));
}

TEST(Flange, ThreeReflectorsTeachRotationSoThatAFourthIsPredictedAsWellAsByItsOwnTraining) {
  const MatrixXd q = random_joints(150, 11);
  const MatrixXd fresh = random_joints(300, 12);
  const BiasModel three = fit_flange(seen_problem(q, {kA, kB, kC}, 11), "se + flange");
  const BiasModel own = fit_flange(seen_problem(q, {kNew}, 12), "se");
  double by_own = 0;
  for (Index i = 0; i < fresh.rows(); ++i) {
    const JointVector at = fresh.row(i);
    by_own += (own.mean_B(at) - error_at_lever_B(at, kNew)).squaredNorm() /
              static_cast<double>(fresh.rows());
  }
  EXPECT_LT(rms_at(three, fresh, kNew), 1.1 * std::sqrt(by_own));
}

double inside_at(const BiasModel& model, const MatrixXd& q, const Vector3& lever_F) {
  Index inside = 0;
  for (Index i = 0; i < q.rows(); ++i) {
    const JointVector at = q.row(i);
    const BiasPrediction prediction = model.predict(at, at_lever(at, lever_F));
    const Vector3 missed = prediction.mean_B - error_at_lever_B(at, lever_F);
    inside += (missed.array().abs() < 1.96 * prediction.stddev_B.array()).count();
  }
  return static_cast<double>(inside) / static_cast<double>(3 * q.rows());
}

// The truth is no draw of the prior: a plain kernel's own intervals hold some 87 % of it.
TEST(Flange, ItsIntervalsCoverALeverThatWasNeverMeasuredAsAPlainKernelCoversItsOwn) {
  const MatrixXd q = random_joints(120, 21);
  const MatrixXd fresh = random_joints(400, 22);
  const double plain = inside_at(fit_flange(seen_problem(q, {kNew}, 21), "se"), fresh, kNew);
  EXPECT_GT(inside_at(fit_flange(seen_problem(q, {kA}, 21), "se + flange"), fresh, kNew),
            plain - 0.03);
  EXPECT_GT(inside_at(fit_flange(seen_problem(q, {kA, kB, kC}, 21), "se + flange"), fresh, kNew),
            plain - 0.03);
}

TEST(Flange, OfOneLeverItIsAsGoodAsAKernelWithoutLeversAndAnotherLeverIsLessSure) {
  const MatrixXd q = random_joints(120, 31);
  const MatrixXd fresh = random_joints(200, 32);
  const BiasProblem problem = seen_problem(q, {kA}, 31);
  const BiasModel plain = fit_flange(problem, "se");
  const BiasModel flange = fit_flange(problem, "se + flange");
  double by_plain = 0;
  for (Index i = 0; i < fresh.rows(); ++i) {
    const JointVector at = fresh.row(i);
    by_plain += (plain.mean_B(at) - error_at_lever_B(at, kA)).squaredNorm() /
                static_cast<double>(fresh.rows());
    const double seen = flange.predict(at, at_lever(at, kA)).stddev_B.norm();
    const double far = flange.predict(at, at_lever(at, kA + Vector3(0.3, 0, 0))).stddev_B.norm();
    EXPECT_GT(far, 1.5 * seen);
    EXPECT_GT(flange.predict(at, at_lever(at, kA + Vector3(0.6, 0, 0))).stddev_B.norm(), far);
  }
  EXPECT_LT(rms_at(flange, fresh, kA), 1.05 * std::sqrt(by_plain));
}

TEST(Flange, ToolsOnPosesOfTheirOwnTellTheSameArm) {
  const MatrixXd q = random_joints(160, 41);
  const Vector3 far(0.4, 0.3, 0.2);
  const BiasProblem first = seen_problem(q.topRows(80), {kA}, 41);
  const BiasProblem second = seen_problem(q.bottomRows(80), {far}, 42);
  BiasProblem both = first;
  both.q.conservativeResize(160, Eigen::NoChange);
  both.q.bottomRows(80) = second.q;
  both.residual_B.conservativeResize(160, Eigen::NoChange);
  both.residual_B.bottomRows(80) = second.residual_B;
  both.sigma.conservativeResize(160);
  both.sigma.tail(80) = second.sigma;
  both.features.insert(both.features.end(), second.features.begin(), second.features.end());
  const MatrixXd fresh = random_joints(300, 43);
  const BiasModel flange = fit_flange(both, "se + flange");
  const BiasModel plain = fit_flange(both, "se");
  for (const Vector3& lever_F : {kA, far})
    EXPECT_LT(rms_at(flange, fresh, lever_F), 0.9 * rms_at(plain, fresh, lever_F));
  EXPECT_GT(flange.report().log_likelihood.sum(), plain.report().log_likelihood.sum() + 50);
}

TEST(Flange, IsChosenWhereThereAreSeveralLeversAndNotAskedWhereThereIsOne) {
  BiasOptions options;
  options.starts = 2;
  const MatrixXd q = random_joints(50, 51);
  const auto several = choose_bias(seen_problem(q, {kA, kB, kC}, 51), options);
  ASSERT_TRUE(several.has_value()) << several.error().message;
  EXPECT_TRUE(several->choice.kernel.ends_with("+ flange")) << several->choice.sentence;
  const auto one = choose_bias(seen_problem(q, {kA}, 51), options);
  ASSERT_TRUE(one.has_value()) << one.error().message;
  for (const BiasCandidate& candidate : one->choice.candidates)
    EXPECT_FALSE(candidate.kernel.ends_with("flange")) << candidate.kernel;
}

TEST(Flange, ARestoredModelAnswersBitForBit) {
  const BiasModel model =
      fit_flange(seen_problem(random_joints(40, 61), {kA, kB}, 61), "matern52 + flange");
  const auto restored = BiasModel::restore(model.state());
  ASSERT_TRUE(restored.has_value()) << restored.error().message;
  const JointVector at = random_joints(1, 62).row(0);
  const BiasPrediction before = model.predict(at, at_lever(at, kNew));
  const BiasPrediction after = restored->predict(at, at_lever(at, kNew));
  EXPECT_EQ(before.mean_B, after.mean_B);
  EXPECT_EQ(before.covariance_B, after.covariance_B);
  EXPECT_EQ(before.prior_share, after.prior_share);
}

TEST(Flange, IsSpelledBesideAKernelAndNotBesideABlock) {
  const auto bias = spelled_bias("matern52 + flange + white");
  ASSERT_TRUE(bias.has_value()) << bias.error().message;
  EXPECT_TRUE(bias->flange);
  EXPECT_EQ(without_flange("matern52 + flange + white"), "matern52 + white");
  EXPECT_EQ(without_flange("flange+se * (linear + white)"), "se * (linear + white)");
  for (const std::string spelling : {"flange", "se + flange + flange", "se * flange",
                                     "(se + flange)", "se + flange + joint_map"}) {
    EXPECT_EQ(refusal_of(check_bias_spelling(spelling)), Refusal("", {}, "bias").text(spelling))
        << spelling;
  }
}

TEST(Flange, MorePosesThanItsMatrixHoldsAreRefusedInWords) {
  const BiasProblem problem = seen_problem(random_joints(700, 71), {kA, kB, kC}, 71);
  BiasOptions options;
  options.kernel = "se + flange";
  const auto model = BiasModel::fit(problem, options);
  ASSERT_FALSE(model.has_value());
  EXPECT_EQ(refusal_of(model), Refusal("", {}, "bias").beyond(700 * 6, kMostFlangeNumbers));
}

}  // namespace
}  // namespace trammel
