#include "server/metrics/work_counts.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

TEST(WorkCounts, TellWhereEachCellWorksAndWhatItWasPromised) {
  WorkCounts counts;
  WorkFigures portion;
  portion.answered(true, 15e-6);
  portion.answered(true, 20e-6);
  portion.answered(false, 2e-3);
  portion.left = 1;
  counts.add("a", portion);
  counts.add("a", portion);
  const auto all = counts.all();
  ASSERT_EQ(all.size(), 1u);
  const WorkFigures& a = all.at("a");
  EXPECT_EQ(a.inside, 4u);
  EXPECT_EQ(a.outside, 2u);
  EXPECT_EQ(a.left, 2u);
  EXPECT_EQ(a.in_class[1], 4u) << "to 0.02 mm";
  EXPECT_EQ(a.in_class.back(), 2u) << "above 1 mm";
  EXPECT_NEAR(a.sum_mm, 2 * 2.035, 1e-9);
}

}  // namespace
}  // namespace trammel
