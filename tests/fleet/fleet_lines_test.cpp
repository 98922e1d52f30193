#include "server/fleet/fleet_lines.h"

#include <gtest/gtest.h>

#include <random>

namespace trammel {
namespace {

BudgetLine zero(int joint, double deg, double u95) {
  BudgetLine line;
  line.line = fmt::format("zero:{}", joint);
  line.kind = LineKind::kJointZero;
  line.joint = joint - 1;
  line.name = fmt::format("the zero of joint {}", joint);
  line.value = BudgetNumber{fmt::format("q{}", joint), deg, u95, "deg"};
  line.times_usual = std::abs(deg) / 0.06;
  line.alone_rms = 5e-3 * std::abs(deg);
  return line;
}

/// An arm whose zeros are of usual size, but for joint 4 where `lost` is given.
ErrorBudget arm(std::mt19937_64& random, double lost = 0) {
  std::normal_distribution<double> deg(0, 0.03);
  ErrorBudget budget;
  for (int joint = 1; joint <= 6; ++joint)
    budget.as_it_stands.lines.push_back(zero(joint, deg(random) + (joint == 4 ? lost : 0), 0.004));
  BudgetLine base;
  base.line = "base";
  base.kind = LineKind::kBase;
  base.value = BudgetNumber{"shift", 300 + deg(random), 0.1, "mm"};
  budget.as_it_stands.lines.push_back(base);
  return budget;
}

std::vector<const ErrorBudget*> all_of(const std::vector<ErrorBudget>& budgets) {
  std::vector<const ErrorBudget*> all;
  for (const ErrorBudget& budget : budgets) all.push_back(&budget);
  return all;
}

TEST(FleetLines, LeadWithTheZeroInWhichARobotDiffersFromItsSisters) {
  std::mt19937_64 random(5);
  std::vector<ErrorBudget> sisters;
  for (int k = 0; k < 4; ++k) sisters.push_back(arm(random));
  const auto lines = lines_among_sisters(arm(random, 1.0), all_of(sisters));
  ASSERT_EQ(lines.size(), 6u) << "the base is no matter of the arm";
  EXPECT_EQ(lines.front().line, "zero:4");
  EXPECT_TRUE(lines.front().differs);
  EXPECT_NEAR(1e3 * lines.front().difference_rms, 5, 0.5);
  EXPECT_FALSE(lines[1].differs);
  EXPECT_NE(to_string(lines.front()).find("the zero of joint 4 is"), std::string::npos);
}

TEST(FleetLines, OfEqualRobotsHardlyAFleetHasOneThatDiffers) {
  std::mt19937_64 random(6);
  int fleets = 0;
  constexpr int kFleets = 200;
  for (int k = 0; k < kFleets; ++k) {
    std::vector<ErrorBudget> robots;
    for (int r = 0; r < (k % 2 == 0 ? 3 : 5); ++r) robots.push_back(arm(random));
    bool any = false;
    for (std::size_t r = 0; r < robots.size(); ++r) {
      std::vector<const ErrorBudget*> sisters;
      for (std::size_t s = 0; s < robots.size(); ++s)
        if (s != r) sisters.push_back(&robots[s]);
      for (const LineAmongSisters& line : lines_among_sisters(robots[r], sisters))
        any = any || line.differs;
    }
    fleets += any ? 1 : 0;
  }
  EXPECT_LE(fleets, 0.08 * kFleets);
}

TEST(FleetLines, OfThreeRobotsNameTheOddOneAndOfTwoNone) {
  std::mt19937_64 random(7);
  const std::vector<ErrorBudget> robots = {arm(random), arm(random, 1.0), arm(random)};
  for (std::size_t own = 0; own < robots.size(); ++own) {
    std::vector<const ErrorBudget*> sisters = all_of(robots);
    sisters.erase(sisters.begin() + static_cast<std::ptrdiff_t>(own));
    const auto lines = lines_among_sisters(robots[own], sisters);
    ASSERT_EQ(lines.size(), 6u);
    EXPECT_EQ(lines.front().differs, own == 1) << own;
    if (own == 1) {
      EXPECT_EQ(lines.front().line, "zero:4");
    }
    EXPECT_FALSE(lines[1].differs) << own;
    sisters.pop_back();
    EXPECT_TRUE(lines_among_sisters(robots[own], sisters).empty()) << "which of two is odd?";
  }
}

}  // namespace
}  // namespace trammel
