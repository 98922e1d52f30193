#include "server/report/budget_page.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <regex>

namespace trammel {
namespace {

BudgetLine line_of_share(int joint, double share) {
  BudgetLine line;
  line.line = fmt::format("zero:{}", joint);
  line.kind = LineKind::kJointZero;
  line.name = fmt::format("the zero of joint {}", joint);
  line.value = BudgetNumber{fmt::format("q{}", joint), 1.5, 0.01, "deg"};
  line.share = share;
  return line;
}

TEST(BudgetPage, StepsLeadFromTheDrawingToTheWholeErrorEachFromWhereTheOneBeforeEnds) {
  ErrorBudget budget;
  budget.poses = 80;
  budget.as_it_stands.error_rms = 1e-3;
  const std::vector<double> shares = {0.6, 0.5, -0.1003, 0.0003};  // the last one has no row
  for (const double share : shares)
    budget.as_it_stands.lines.push_back(
        line_of_share(static_cast<int>(budget.as_it_stands.lines.size()) + 1, share));
  budget.as_it_stands.lines.front().action = "re-master joint 1";
  budget.as_it_stands.lines.front().with = {"length:6"};
  budget.beyond_frames.lines = {line_of_share(2, -1e-5)};
  const std::string page = budget_section(budget);
  EXPECT_EQ(page.find("-0.0 %"), std::string::npos) << "nothing has no sign";
  EXPECT_NE(page.find("0.0 %"), std::string::npos) << page;
  const std::regex rect("rect x=\"([0-9.]+)\" width=\"([0-9.]+)\"");
  std::vector<std::pair<double, double>> bars;
  for (std::sregex_iterator at(page.begin(), page.end(), rect), end; at != end; ++at)
    bars.emplace_back(std::stod((*at)[1]), std::stod((*at)[2]));
  ASSERT_EQ(bars.size(), 4u) << page;
  const double whole = bars[1].first + bars[1].second;  // 1.1 of the error
  EXPECT_NEAR(bars[0].first, 0, 0.1);
  EXPECT_NEAR(bars[0].second, whole * 0.6 / 1.1, 0.1);
  EXPECT_NEAR(bars[1].first, bars[0].second, 0.1);
  EXPECT_NEAR(bars[2].first + bars[2].second, whole, 0.1) << "a negative share leads back";
  EXPECT_NEAR(bars[3].first, whole * 1.0 / 1.1, 0.2) << "what has no row leads to the whole";
  for (const char* part : {"re-master joint 1", "the lengths of link 6", "1.500 ± 0.010 deg"})
    EXPECT_NE(page.find(part), std::string::npos) << part << "\n" << page;
  EXPECT_EQ(page.find("length:6"), std::string::npos) << page;
}

}  // namespace
}  // namespace trammel
