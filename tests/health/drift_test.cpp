#include "server/health/drift.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trammel {
namespace {

constexpr std::int64_t kDay = 86400;
constexpr int kCauses = 30;             // directions in which an arm drifts
constexpr double kNoise = 1e-5;         // m, of each as a check sees it
constexpr double kRate = 1e-10 / kDay;  // m^2/s: 10 um a day

/// Checks of one arm, some days after its model, whose walk is drawn with `seed`.
std::vector<DriftSeen> checks_of(const std::vector<int>& days, double rate, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> at(kCauses, 0.0);
  std::vector<DriftSeen> checks;
  int before = 0;
  for (const int day : days) {
    DriftSeen seen{1000 * kDay, (1000 + day) * kDay, {}};
    const double step = std::sqrt(rate * static_cast<double>((day - before) * kDay) / kCauses);
    double square = 0;
    for (double& one : at) {
      one += step * normal(random);
      square += std::pow((one + kNoise * normal(random)) / kNoise, 2);
    }
    before = day;
    for (const double variance : drift_variances()) {
      const double all = 1 + variance / kCauses / (kNoise * kNoise);
      seen.misfit.push_back(kCauses * std::log(all) + square / all);
    }
    checks.push_back(std::move(seen));
  }
  return checks;
}

TEST(Drift, TheRateIsBetweenItsBoundsAndSeveralChecksKnowItBetter) {
  int above = 0, below = 0;
  double one = 0, several = 0;
  constexpr int kSeeds = 200;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const std::vector<DriftSeen> checks = checks_of({30, 60, 90, 120, 150, 180}, kRate, 100 + seed);
    const DriftRate rate = *drift_rate(checks);
    above += rate.least > kRate ? 1 : 0;
    below += rate.most < kRate ? 1 : 0;
    one += std::log(drift_rate({checks.front()})->most / kRate);
    several += std::log(rate.most / kRate);
    EXPECT_EQ(rate.checks, 6);
    EXPECT_LT(rate.weight, 4) << "all saw the first month";
    EXPECT_NEAR(rate.span, 180.0 * kDay, 1);
  }
  EXPECT_LE(above, 0.08 * kSeeds);
  EXPECT_LE(below, 0.08 * kSeeds);
  EXPECT_LT(several, 0.8 * one);
}

TEST(Drift, AnArmThatStandsStillIsKnownToTheLongerItWasWatched) {
  const double after_a_month = drift_rate(checks_of({30}, 0, 3))->most;
  const DriftRate after_a_year = *drift_rate(checks_of({30, 90, 180, 270, 360}, 0, 3));
  EXPECT_EQ(after_a_year.least, 0);
  EXPECT_LT(after_a_year.most, 0.2 * after_a_month);
}

TEST(Drift, ChecksOfAModelThatWasMeasuredAnewAreAsGoodAsOthers) {
  std::vector<DriftSeen> apart = checks_of({30}, kRate, 1);
  for (int k = 1; k <= 3; ++k) {
    std::vector<DriftSeen> one = checks_of({30}, kRate, 1 + static_cast<std::uint64_t>(k));
    one.front().from += 40 * k * kDay;
    one.front().until += 40 * k * kDay;
    apart.push_back(one.front());
  }
  EXPECT_NEAR(drift_rate(apart)->weight, 4, 1e-9);
  apart[1].from = apart[0].from;
  apart[1].until = apart[0].until;
  EXPECT_LT(drift_rate(apart)->weight, 3.1) << "the same time twice";
}

TEST(Drift, WhatSaysNothingIsLeftOut) {
  DriftSeen soon = checks_of({1}, kRate, 1).front();
  soon.until = soon.from + 3600;
  EXPECT_FALSE(drift_rate({soon}));
  DriftSeen cut = checks_of({30}, kRate, 1).front();
  cut.misfit.pop_back();
  EXPECT_FALSE(drift_rate({cut}));
  EXPECT_FALSE(drift_rate({}));
}

}  // namespace
}  // namespace trammel
