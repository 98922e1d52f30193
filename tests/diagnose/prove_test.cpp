#include "server/diagnose/prove/prove.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/diagnose/diagnose.h"
#include "server/diagnose/prove/named_curve.h"
#include "server/diagnose/prove/own_residuals.h"
#include "tests/support/demand.h"
#include "tests/support/quick_diagnosis.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Counts `tries` diagnoses, each named with the chance that `named` has for its strength.
template <typename Named>
NamedCurve counted(int tries, std::uint64_t seed, const Named& named) {
  NamedCurve curve;
  SeededRandom random(seed);
  for (int k = 0; k < tries; ++k) {
    const double strength =
        strength_put_in(curve.next(k % 3 == 2 ? 0.5 : kProvedShare, random.uniform(0, 1)));
    curve.count(strength, random.uniform(0, 1) < named(strength));
  }
  return curve;
}

TEST(NamedCurve, HasTheStrengthThatIsNamedInNineOfTenWithinItsInterval) {
  constexpr double kTruth = 70;  // of a curve whose share there is 0.9
  const auto named = [](double strength) {
    return 1 / (1 + std::pow(kTruth / strength, 1 / 0.2) / 9);
  };
  int inside = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const NamedCurve::Smallest smallest = counted(120, seed, named).smallest();
    ASSERT_TRUE(smallest.median && smallest.from && smallest.to) << seed;
    EXPECT_NEAR(std::log(*smallest.median / kTruth), 0, 2 * std::log(1.3)) << seed << ": size";
    inside += *smallest.from <= kTruth && kTruth <= *smallest.to ? 1 : 0;
  }
  EXPECT_GE(inside, 16) << "of 20 intervals of 95 %";
}

TEST(NamedCurve, SaysThatNoSizeIsNamedWhereNoneIs) {
  EXPECT_GT(counted(20, 1, [](double) { return 0.0; }).smallest().never, 0.975);
  EXPECT_GT(counted(60, 1, [](double) { return 0.4; }).smallest().never, 0.975)
      << "four of ten, however strong";
  EXPECT_LT(counted(60, 1, [](double) { return 1.0; }).smallest().never, 0.025);
}

TEST(NamedCurve, KnowsNothingBeforeTheFirstDiagnosis) {
  EXPECT_NEAR(NamedCurve().smallest().never, 0.5, 1e-9);
}

/// The chapter 5 robot, calibrated.
struct CalibratedArm {
  explicit CalibratedArm(int poses) {
    batch = MeasurementBatch(
        check_against_cell(test::measured(test::chapter_5_robot(cell), poses, 3), *cell)->rows());
    const CalibrationResult calibration = *calibrate(cell, cell->model.error_sources, batch, {});
    model = calibration.model;
    for (const IdentifiedParameter& one : calibration.parameters) priors.push_back(one.parameter);
  }
  LinearProblem problem() const { return {model, batch, priors, {}}; }
  std::shared_ptr<const Cell> cell = test::cell_7();
  MeasurementBatch batch;
  PhysicalModel model;
  std::vector<Parameter> priors;
};

TEST(OwnResiduals, WhatTheModelLeavesOverGivesTheBatchBack) {
  const CalibratedArm arm(45);
  const LinearProblem problem = arm.problem();
  const MeasurementBatch again = OwnResiduals(problem).measured(problem.residual());
  ASSERT_EQ(again.measurements.size(), arm.batch.measurements.size());
  for (std::size_t i = 0; i < again.measurements.size(); ++i) {
    const Measurement& was = arm.batch.measurements[i];
    EXPECT_LT((again.measurements[i].p_W - was.p_W).norm(), 1e-9);
    EXPECT_LT((*again.measurements[i].R_WT - *was.R_WT).norm(), 1e-9);
  }
}

TEST(OwnResiduals, StayAtTheirPosesAndAsLargeAsTheNoiseButGoWithNothing) {
  const CalibratedArm arm(120);
  const LinearProblem problem = arm.problem();
  const OwnResiduals residuals(problem);
  SeededRandom random(5);
  const VectorXd first = residuals.drawn(random);
  EXPECT_NEAR(first.squaredNorm() / static_cast<double>(first.size()), 1, 0.15);
  constexpr int kDraws = 400;
  VectorXd sum = VectorXd::Zero(first.size());
  for (int k = 0; k < kDraws; ++k) {
    const VectorXd drawn = residuals.drawn(random);
    EXPECT_LT((drawn.cwiseAbs() - first.cwiseAbs()).norm(), 1e-9);
    sum += drawn;
  }
  EXPECT_LT((sum / kDraws).norm(), 3 * first.norm() / std::sqrt(kDraws));
}

/// Makes some diagnoses of a round that the time cuts short.
using ForEach = decltype(ProveOptions::for_each);

/// A diagnosis of 60 poses, and of its proof the diagnoses that `for_each` makes in `rounds`.
Diagnosis proved(int rounds, const ForEach& for_each) {
  DiagnoseOptions options = test::quick();
  options.prove = {.has_time = [rounds](int round) { return round < rounds; },
                   .for_each = for_each};
  return test::demand(diagnose(
      test::cell_7(), test::measured(test::chapter_5_robot(test::cell_7()), 60, 5), options));
}

TEST(Proof, IsTheSameInWhateverOrderItsDiagnosesAreMade) {
  constexpr std::size_t kMade = 6;
  const Diagnosis forwards = proved(1, [](std::size_t, const auto& work) {
    for (std::size_t k = 0; k < kMade; ++k) work(k);
  });
  ASSERT_TRUE(forwards.proof);
  const Proof& proof = *forwards.proof;
  ASSERT_GT(proof.causes.size(), 10U);
  EXPECT_EQ(proof.refused, 0);
  EXPECT_TRUE(forwards.recovery.empty()) << "the proof stands for it";
  for (std::size_t k = 0; k < proof.causes.size(); ++k) {
    const ProvedCause& one = proof.causes[k];
    ASSERT_EQ(one.sizes.size(), k < kMade ? 1U : 0U) << to_string(one.cause);
    EXPECT_FALSE(one.is_proved() || one.never) << to_string(one.cause);
  }
  const Diagnosis backwards = proved(1, [](std::size_t, const auto& work) {
    for (std::size_t k = kMade; k > 0; --k) work(k - 1);
  });
  for (std::size_t k = 0; k < kMade; ++k) {
    const PutIn &one = proof.causes[k].sizes[0], &other = backwards.proof->causes[k].sizes[0];
    EXPECT_EQ(one.tried, 1);
    EXPECT_GT(one.effect_rms, 0) << to_string(proof.causes[k].cause);
    EXPECT_EQ(one.effect_rms, other.effect_rms);
    EXPECT_EQ(one.found, other.found) << to_string(proof.causes[k].cause);
    EXPECT_EQ(one.named, other.named) << to_string(proof.causes[k].cause);
    EXPECT_EQ(one.misnamed, other.misnamed) << to_string(proof.causes[k].cause);
  }
}

/// Effects of some sizes, counted together.
PutIn together(const ProvedCause& cause, double above, double below) {
  PutIn sum;
  for (const PutIn& size : cause.sizes) {
    if (size.effect_rms < above || size.effect_rms > below) continue;
    sum.tried += size.tried;
    sum.found += size.found;
    sum.named += size.named;
    sum.misnamed += size.misnamed;
  }
  return sum;
}

TEST(Proof, NamesALargeEffectAndNotASmallOneAndNothingWhereNothingWasPutIn) {
  const auto is_ripple = [](const ProvedCause& one) {
    return one.cause.cause == "gear_transmission" && one.cause.joint == 0;
  };
  const Diagnosis untried = proved(0, [](std::size_t, const auto&) {});
  const std::vector<ProvedCause>& causes = untried.proof->causes;
  const auto place = static_cast<std::size_t>(
      std::find_if(causes.begin(), causes.end(), is_ripple) - causes.begin());
  ASSERT_LT(place, causes.size());
  constexpr int kRounds = 12;
  const Diagnosis diagnosis = proved(kRounds, [&](std::size_t count, const auto& work) {
    work(place);
    work(count - 1);
  });
  const ProvedCause& ripple = diagnosis.proof->causes[place];
  ASSERT_TRUE(is_ripple(ripple) && ripple.predicted);
  const PutIn all = together(ripple, 0, 1);
  EXPECT_EQ(all.tried, kRounds);
  EXPECT_LE(all.misnamed, 1);
  EXPECT_GE(all.found, all.named);
  const PutIn large = together(ripple, 3 * *ripple.predicted, 1);
  EXPECT_GT(large.tried, 0);
  EXPECT_EQ(large.named, large.tried);
  const PutIn small = together(ripple, 0, 0.5 * *ripple.predicted);
  EXPECT_LE(2 * small.named, small.tried);
  EXPECT_EQ(diagnosis.proof->healthy.tried, kRounds);
  EXPECT_EQ(diagnosis.proof->healthy.misnamed, 0);
}

TEST(Proof, ThatHasNoTimeTellsThePredictedSizesAndThatNothingIsDecided) {
  DiagnoseOptions options = test::quick();
  options.prove = {.has_time = [](int) { return false; },
                   .for_each = [](std::size_t, const auto&) { FAIL() << "no time"; }};
  const Diagnosis diagnosis = test::demand(diagnose(
      test::cell_7(), test::measured(test::chapter_5_robot(test::cell_7()), 60, 5), options));
  ASSERT_FALSE(diagnosis.proof->causes.empty());
  for (const ProvedCause& one : diagnosis.proof->causes) {
    EXPECT_TRUE(one.sizes.empty());
    EXPECT_FALSE(one.smallest || one.never);
  }
}

}  // namespace
}  // namespace trammel::cause_search
