#include "server/trainer/paired_gain.h"

#include <gtest/gtest.h>

#include <random>

namespace trammel {
namespace {

Eigen::Matrix3Xd noise(Eigen::Index poses, double sigma, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, sigma);
  return Eigen::Matrix3Xd::NullaryExpr(3, poses, [&] { return normal(random); });
}

TEST(PairedGain, OfAModelOverItselfIsNone) {
  const Eigen::Matrix3Xd errors = noise(40, 1e-5, 1);
  EXPECT_EQ(paired_gain(errors, errors).z, 0);
  EXPECT_FALSE(paired_gain(errors, errors).beyond_chance());
}

TEST(PairedGain, OfEquallyGoodModelsIsBeyondChanceInOneOfAHundredCases) {
  int better = 0, smaller = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const PairedGain gain = paired_gain(noise(30, 1e-5, 2 * seed), noise(30, 1e-5, 2 * seed + 1));
    better += gain.beyond_chance() ? 1 : 0;
    smaller += gain.rms_after < gain.rms_before ? 1 : 0;
  }
  EXPECT_GT(smaller, 900);
  EXPECT_LT(better, 40);
  EXPECT_GT(better, 0);
}

TEST(PairedGain, OfAModelThatLeavesLessEverywhereIsBeyondChanceUnlessThePosesAreFew) {
  const Eigen::Matrix3Xd errors = noise(30, 1e-5, 3);
  EXPECT_TRUE(paired_gain(errors, 0.7 * errors).beyond_chance());
  EXPECT_FALSE(paired_gain(0.7 * errors, errors).beyond_chance());
  EXPECT_FALSE(paired_gain(errors.leftCols(5), 0.1 * errors.leftCols(5)).beyond_chance());
}

}  // namespace
}  // namespace trammel
