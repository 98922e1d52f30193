#include "server/compensate/paired_gain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace trammel {
namespace {

Eigen::Matrix3Xd noise(Eigen::Index poses, double sigma, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, sigma);
  return Eigen::Matrix3Xd::NullaryExpr(3, poses, [&] { return normal(random); });
}

/// Some poses have errors many times those of the others: Student's t with two degrees of freedom,
/// pose by pose.
Eigen::Matrix3Xd heavy_tailed(Eigen::Index poses, double sigma, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::chi_squared_distribution<double> chi_squared(2);
  Eigen::Matrix3Xd errors = noise(poses, sigma, seed + 1000000);
  for (auto error : errors.colwise()) error *= std::sqrt(2 / chi_squared(random));
  return errors;
}

/// The number of 2000 pairs of equally good models in which one is called better.
template <typename Errors>
int called_better(const Errors& errors, Eigen::Index poses) {
  int better = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    better += paired_gain(errors(poses, 1e-5, 2 * seed), errors(poses, 1e-5, 2 * seed + 1))
                      .beyond_chance()
                  ? 1
                  : 0;
  }
  return better;
}

/// Errors of which one coordinate is left, so that the squares differ by `less` (m²).
PairedGain gain_of(const std::vector<double>& less) {
  Eigen::Matrix3Xd before = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(less.size())),
                   after = before;
  for (std::size_t i = 0; i < less.size(); ++i) {
    (less[i] > 0 ? before : after)(0, static_cast<Eigen::Index>(i)) = std::sqrt(std::abs(less[i]));
  }
  return paired_gain(before, after);
}

TEST(PairedGain, OfAModelOverItselfIsNone) {
  const Eigen::Matrix3Xd errors = noise(40, 1e-5, 1);
  EXPECT_EQ(paired_gain(errors, errors).z(), 0);
  EXPECT_FALSE(paired_gain(errors, errors).beyond_chance());
}

TEST(PairedGain, IsWilcoxonsSignedRankStatisticOrThatOfTheSum) {
  // Ranks 1, 2.5, 2.5, 4, 5 of which 2.5 is against; the pose without a difference has none.
  EXPECT_NEAR(gain_of({1, 4, -4, 0, 9, 16}).z_ranks, (1 + 2.5 - 2.5 + 4 + 5) / std::sqrt(55.0),
              1e-12);
  EXPECT_NEAR(gain_of({-1, -4, -9}).z_ranks, -6 / std::sqrt(14.0), 1e-12);
  EXPECT_NEAR(gain_of({1, 4, -4, 0, 9, 16}).z_sum, 26 / std::sqrt(1.0 + 16 + 16 + 81 + 256), 1e-12);
}

TEST(PairedGain, CountsWhereACauseActsAtAFewPosesOnly) {
  int accepted = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const Eigen::Matrix3Xd left = noise(60, 14e-6, 2 * seed);
    Eigen::Matrix3Xd before = left;
    before.leftCols(12) += 3 * noise(12, 14e-6, 2 * seed + 1);
    accepted += paired_gain(before, left).beyond_chance() ? 1 : 0;
  }
  EXPECT_GT(accepted, 90);
}

TEST(PairedGain, OfEquallyGoodModelsIsBeyondChanceInLessThanTwoOfAHundredCases) {
  for (const Eigen::Index poses : {8, 24, 30, 100}) {
    EXPECT_LT(called_better(noise, poses), 40) << poses << " poses";
    EXPECT_LT(called_better(heavy_tailed, poses), 40) << poses << " poses, heavy tails";
  }
  EXPECT_GT(called_better(noise, 30), 0);
}

TEST(PairedGain, OfAModelThatLeavesLessEverywhereIsBeyondChanceUnlessThePosesAreFew) {
  const Eigen::Matrix3Xd errors = noise(30, 1e-5, 3);
  EXPECT_TRUE(paired_gain(errors, 0.7 * errors).beyond_chance());
  EXPECT_FALSE(paired_gain(0.7 * errors, errors).beyond_chance());
  for (Eigen::Index few = 1; few <= 6; ++few) {
    EXPECT_FALSE(paired_gain(errors.leftCols(few), 0.1 * errors.leftCols(few)).beyond_chance())
        << few;
    EXPECT_FALSE(gain_of(std::vector<double>(static_cast<std::size_t>(few), 1e-10)).beyond_chance())
        << few << " ties";
  }
}

TEST(PairedGain, CountsWhereAFewPosesHadMostOfTheError) {
  int accepted = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const Eigen::Matrix3Xd left = noise(24, 14e-6, 2 * seed);
    accepted +=
        paired_gain(left + heavy_tailed(24, 25e-6, 2 * seed + 1), left).beyond_chance() ? 1 : 0;
  }
  EXPECT_GT(accepted, 90);
}

TEST(PairedGain, DoesNotCountWhereMostPosesAreBetterAndTheOthersMuchWorse) {
  const Eigen::Matrix3Xd before = noise(30, 1e-5, 4);
  Eigen::Matrix3Xd after = 0.5 * before;
  after.leftCols(2) = 20 * before.leftCols(2);
  const PairedGain gain = paired_gain(before, after);
  EXPECT_GT(gain.z(), PairedGain::kBeyondChance);
  EXPECT_FALSE(gain.beyond_chance());
  EXPECT_NE(to_string(gain).find("better at most poses, but much worse at others"),
            std::string::npos);
}

/// Three reflectors see one error of the arm: rows that agree are no three witnesses.
TEST(PairedGain, CountsThePosesAndNotTheReflectorsThatSeeThem) {
  constexpr Eigen::Index kPoses = 20;
  int better = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    const Eigen::Matrix3Xd one = noise(kPoses, 1e-5, 2 * seed),
                           other = noise(kPoses, 1e-5, 2 * seed + 1);
    std::vector<PoseGroup> poses;
    for (Eigen::Index i = 0; i < kPoses; ++i) poses.push_back({i, i + kPoses, i + 2 * kPoses});
    const PairedGain gain = paired_gain(one.replicate<1, 3>(), other.replicate<1, 3>(), poses);
    EXPECT_EQ(gain.poses, kPoses);
    EXPECT_NEAR(gain.z(), paired_gain(one, other).z(), 1e-9);
    better += gain.beyond_chance() ? 1 : 0;
  }
  EXPECT_LE(better, 8) << "one in a hundred equally good models";
}

TEST(PairedGain, IsNoneWhereAnErrorIsNotFinite) {
  Eigen::Matrix3Xd before = noise(30, 1e-5, 5);
  const Eigen::Matrix3Xd after = 0.5 * before;
  before(1, 7) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(paired_gain(before, after).beyond_chance());
  EXPECT_EQ(paired_gain(before, after).z(), 0);
}

}  // namespace
}  // namespace trammel
