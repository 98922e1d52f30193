#include "server/bias/choose_bias.h"

#include <gtest/gtest.h>

#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// The residuals of a complete physics: the tracker's noise.
BiasProblem noise_alone(Index count, std::uint64_t seed) {
  BiasProblem problem = smooth_problem(count, seed);
  std::mt19937_64 random(seed + 900);
  for (double& value : problem.residual_B.reshaped()) value = problem.sigma[0] * normal(&random);
  return problem;
}

TEST(ChooseBias, TakesNoneOfNoise) {
  for (const Index count : {40, 150, 400}) {
    for (const std::uint64_t seed : {1, 2, 3}) {
      const ChosenBias chosen = choose_bias(noise_alone(count, seed), {}).value();
      EXPECT_EQ(chosen.choice.kernel, "none")
          << count << " " << seed << ": " << chosen.choice.sentence;
      EXPECT_FALSE(chosen.model);
      EXPECT_EQ(chosen.choice.candidates.front().verdict, "taken");
      EXPECT_TRUE(chosen.choice.sentence.starts_with("no bias helps: the residual is "))
          << chosen.choice.sentence;
      EXPECT_TRUE(chosen.choice.sentence.ends_with("; left out")) << chosen.choice.sentence;
    }
  }
}

TEST(ChooseBias, TakesTheKernelOfASmoothResidualAndSaysWhatItIsWorth) {
  const BiasProblem problem = smooth_problem(200, 1);
  const ChosenBias chosen = choose_bias(problem, {}).value();
  EXPECT_EQ(chosen.choice.kernel, "se");
  ASSERT_TRUE(chosen.model);
  EXPECT_EQ(chosen.model->state().kernel, "se");
  ASSERT_EQ(chosen.choice.candidates.size(), 3u);  // none, se, matern52: no features, so no blocks
  const BiasCandidate& none = chosen.choice.candidates[0];
  const BiasCandidate& se = chosen.choice.candidates[1];
  EXPECT_NEAR(se.leave_one_out_rms, chosen.model->report().leave_one_out_rms, 1e-12);
  EXPECT_LT(se.time_block_rms, 0.5 * none.time_block_rms);
  EXPECT_GE(se.joint_block_rms, se.leave_one_out_rms);
  EXPECT_GT(se.gain, 2 * se.gain_stddev);
  EXPECT_NE(chosen.choice.candidates[2].verdict, "taken");
}

TEST(ChooseBias, SameProblemAndSeedSameChoice) {
  const BiasProblem problem = smooth_problem(60, 3);
  const ChosenBias one = choose_bias(problem, {}).value();
  const ChosenBias other = choose_bias(problem, {}).value();
  EXPECT_EQ(one.choice.sentence, other.choice.sentence);
  for (std::size_t i = 0; i < one.choice.candidates.size(); ++i) {
    EXPECT_EQ(one.choice.candidates[i].time_block_rms, other.choice.candidates[i].time_block_rms);
  }
}

TEST(ChooseBias, WhatNeighboursInTimeShareIsNoReasonForABias) {
  // Eight poses measured twenty times each, while something drifts: poses left out one by one are
  // predicted by their neighbours, whole visits are not.
  BiasProblem problem = smooth_problem(160, 4);
  std::mt19937_64 random(77);
  for (Index visit = 0; visit < 8; ++visit) {
    Eigen::RowVectorXd q = problem.q.row(visit);
    const Eigen::RowVector3d drift =
        20 * problem.sigma[0] *
        Eigen::RowVector3d(normal(&random), normal(&random), normal(&random));
    for (Index i = 20 * visit; i < 20 * (visit + 1); ++i) {
      for (Index j = 0; j < q.size(); ++j) problem.q(i, j) = q(j) + 0.01 * normal(&random);
      for (Index d = 0; d < 3; ++d)
        problem.residual_B(i, d) = drift(d) + problem.sigma[0] * normal(&random);
    }
  }
  const ChosenBias chosen = choose_bias(problem, {}).value();
  EXPECT_EQ(chosen.choice.kernel, "none") << chosen.choice.sentence;
  EXPECT_LT(chosen.choice.candidates[1].leave_one_out_rms,
            0.8 * chosen.choice.candidates[0].leave_one_out_rms);
  EXPECT_NE(chosen.choice.sentence.find("neighbours in time"), std::string::npos)
      << chosen.choice.sentence;
}

TEST(ChooseBias, WhatOnlyTheReflectorsOfAPoseShareIsNoReasonForABias) {
  BiasProblem problem = noise_alone(180, 6);
  for (Index i = 0; i < 180; ++i) {
    if (i % 3 == 0) continue;
    problem.q.row(i) = problem.q.row(i - i % 3);
    problem.residual_B.row(i) =
        5 * problem.residual_B.row(i - i % 3) + 0.5 * problem.residual_B.row(i);
  }
  for (Index i = 0; i < 180; i += 3) problem.residual_B.row(i) *= 5;
  const ChosenBias chosen = choose_bias(problem, {}).value();
  EXPECT_EQ(chosen.choice.kernel, "none") << chosen.choice.sentence;
  const BiasCandidate& none = chosen.choice.candidates[0];
  // The other reflectors of a pose would tell nine tenths of it.
  EXPECT_GT(chosen.choice.candidates[1].leave_one_out_rms, 0.5 * none.leave_one_out_rms);
}

TEST(ChooseBias, CountsPosesAndNotTheirReflectors) {
  BiasProblem problem = smooth_problem(60, 1);
  for (Index i = 0; i < 60; ++i) problem.q.row(i) = problem.q.row(i - i % 3);
  const ChosenBias chosen = choose_bias(problem, {}).value();
  EXPECT_NE(chosen.choice.sentence.find("20 poses are too few"), std::string::npos)
      << chosen.choice.sentence;
}

/// Each of the poses of a smooth residual is seen by three reflectors.
BiasProblem seen_by_three(Index poses, std::uint64_t seed) {
  const BiasProblem once = smooth_problem(poses, seed);
  BiasProblem problem = smooth_problem(3 * poses, seed);
  std::mt19937_64 random(seed + 40);
  for (Index i = 0; i < 3 * poses; ++i) {
    problem.q.row(i) = once.q.row(i / 3);
    problem.residual_B.row(i) = once.residual_B.row(i / 3);
    for (double& value : problem.residual_B.row(i)) value += once.sigma[0] * normal(&random);
  }
  return problem;
}

TEST(ChooseBias, SomeOfManyRowsChooseByWholePosesAndAllAreLearned) {
  const BiasProblem problem = seen_by_three(500, 7);
  std::size_t largest = 0;
  const auto without = [&](const std::vector<Index>& block) -> MatrixXd {
    largest = std::max(largest, block.size());
    EXPECT_EQ(block.size() % 3, 0u) << "whole poses";
    return problem.residual_B;
  };
  const ChosenBias chosen = choose_bias(problem, {}, without).value();
  EXPECT_EQ(chosen.choice.kernel, "se") << chosen.choice.sentence;
  EXPECT_TRUE(chosen.choice.sentence.ends_with("; chosen by 900 of 1500 rows"))
      << chosen.choice.sentence;
  EXPECT_LE(largest, 120u);
  ASSERT_TRUE(chosen.model);
  EXPECT_EQ(chosen.model->state().q.rows(), 1500);
  BiasOptions all;
  all.kernel = "se";
  const BiasModel searched = BiasModel::fit(problem, all).value();
  EXPECT_LT(chosen.model->report().leave_one_out_rms, 1.02 * searched.report().leave_one_out_rms);
}

TEST(ChooseBias, ThePhysicsThatKnewABlockIsNotAskedAboutIt) {
  const BiasProblem problem = smooth_problem(80, 5);
  std::vector<std::size_t> asked;
  const ChosenBias chosen =
      choose_bias(problem, {}, [&](const std::vector<Index>& block) -> MatrixXd {
        asked.push_back(block.size());
        MatrixXd residual = problem.residual_B;
        residual(block, 0).array() += 1.0;  // m: without them nothing is known of them
        return residual;
      }).value();
  EXPECT_EQ(asked, std::vector<std::size_t>(16, 10));  // eight blocks in time, eight in joint space
  EXPECT_GT(chosen.choice.candidates[0].time_block_rms, 0.9);
  EXPECT_EQ(chosen.choice.kernel, "none");
}

TEST(ChooseBias, ABlockThatThePhysicsCannotSpareDoesNotJudgeAndTheSentenceSaysSo) {
  const BiasProblem problem = smooth_problem(80, 5);
  int asked = 0;
  const auto choice_where_fail = [&](int blocks) {
    asked = 0;
    return choose_bias(problem, {},
                       [&](const std::vector<Index>& block) -> std::optional<MatrixXd> {
                         if (asked++ < blocks) return std::nullopt;
                         MatrixXd residual = problem.residual_B;
                         residual(block, Eigen::all).setConstant(0.5);  // m
                         return residual;
                       })
        .value()
        .choice;
  };
  const BiasChoice some = choice_where_fail(3);
  EXPECT_NEAR(some.candidates.front().time_block_rms, std::sqrt(3 * 0.25), 1e-12)
      << "of the other five blocks alone";
  EXPECT_TRUE(some.sentence.ends_with(
      "; 3 of 16 blocks do not judge: without them the physics cannot be identified"))
      << some.sentence;
  const BiasChoice few = choice_where_fail(5);
  EXPECT_EQ(few.kernel, "none");
  EXPECT_TRUE(few.candidates.empty());
  EXPECT_NE(few.sentence.find("too little is left to identify the physics"), std::string::npos)
      << few.sentence;
}

TEST(ChooseBias, SaysHowFarItIsAndStopsWhenToldToWhileBlocksAreLeftOut) {
  BiasOptions options;
  std::vector<double> shares;
  options.progress = [&](double share) {
    shares.push_back(share);
    return true;
  };
  const BiasProblem problem = noise_alone(60, 7);
  ASSERT_TRUE(choose_bias(problem, options));
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  // The first of five kernels: fitted at a tenth of the whole, each of its sixteen blocks left out
  // by a fifth.
  EXPECT_EQ(std::count_if(shares.begin(), shares.end(),
                          [](double share) { return share > 0.1 && share <= 0.2; }),
            16);
  options.progress = [](double share) { return share < 0.15; };
  const auto stopped = choose_bias(problem, options);
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ErrorCode::kBusy);
}

TEST(ChooseBias, ABiasIsWorthItWhereItIsClearlyLikelierThanNone) {
  const BiasProblem smooth = smooth_problem(100, 8);
  EXPECT_TRUE(is_worth_it(smooth, BiasModel::fit(smooth, {}).value()));
  const BiasProblem noise = noise_alone(100, 8);
  EXPECT_FALSE(is_worth_it(noise, BiasModel::fit(noise, {}).value()));
}

TEST(ChooseBias, KernelsWithBlocksAreSkippedWhereThereAreMoreObservationsThanTheyMayHave) {
  BiasProblem problem = noise_alone(40, 6);
  std::mt19937_64 random(6);
  for (Index i = 0; i < 40; ++i) {
    BiasFeatures at{MatrixXd::Zero(6, problem.q.cols()), MatrixXd(6, 2)};
    for (double& value : at.by_parameter.reshaped()) value = 1e-4 * normal(&random);
    problem.features.push_back(at);
  }
  const auto last_of = [&](Index most_coupled) {
    return choose_bias(problem, {}, {}, most_coupled).value().choice.candidates.back();
  };
  EXPECT_FALSE(last_of(40).skipped);
  const BiasCandidate skipped = last_of(39);
  EXPECT_EQ(skipped.kernel, "se + parameters");
  EXPECT_TRUE(skipped.skipped);
  EXPECT_EQ(skipped.verdict, "more than 39 poses");
  const ChosenBias chosen = choose_bias(problem, {}, {}, 39).value();
  EXPECT_EQ(chosen.choice.sentence.find("se + parameters"), std::string::npos)
      << chosen.choice.sentence;
}

TEST(ChooseBias, TooFewObservationsAreNotJudged) {
  const ChosenBias chosen = choose_bias(smooth_problem(29, 1), {}).value();
  EXPECT_EQ(chosen.choice.kernel, "none");
  EXPECT_NE(chosen.choice.sentence.find("29 poses are too few"), std::string::npos);
  EXPECT_FALSE(choose_bias(smooth_problem(5, 1), {}));
}

}  // namespace
}  // namespace trammel
