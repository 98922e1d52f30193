#include "server/report/view_page.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "tests/report/seen_by_browser.h"
#include "tests/support/demand.h"
#include "tests/support/page_text.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

using test::has;

Cell cell_among(const std::string& keys) {
  return test::demand(
      parse_cell(test::small_cell_yaml("cell-7") + keys, test::small_robot_yaml(), "cell-7.yaml"));
}

constexpr const char* kObstacles =
    "obstacles:\n  floor_mm: -500\n"
    "  boxes: {\"<b>table\": {lower: [900, -600, -500], upper: [2100, 600, 900]}}\n"
    "workspace_mm: {lower: [-3000, -3000, -3000], upper: [3000, 3000, 3500]}\n";

Viewed two_poses(const Cell& cell) {
  Viewed viewed{"plan.csv"};
  for (const double first : {0.0, 120.0}) {
    ViewedPose pose{first > 0 ? "away" : "low<1>", {}, true};
    pose.context.q = JointVector::Zero(cell.robot.size());
    pose.context.q(0) = from_deg(first);
    pose.context.q(1) = from_deg(first > 0 ? -20 : 60);
    pose.context.tool = cell.tools.begin()->first;
    viewed.poses.push_back(pose);
  }
  return viewed;
}

TEST(ViewPage, SaysWhichPosesTouchAndCountsThem) {
  const Cell cell = cell_among(kObstacles);
  const Viewed viewed = two_poses(cell);
  const ViewFindings found = view_findings(cell, viewed);
  EXPECT_EQ(found.poses, 2u);
  EXPECT_EQ(found.touching, 1u);
  EXPECT_EQ(found.unseen, 0u);
  EXPECT_EQ(found.outside, 0u);
  const std::string page = view_page(cell, viewed);
  for (const char* part : {"Of 2 poses 1 touch an obstacle.", "low&lt;1&gt;", "plan.csv",
                           "box &lt;b&gt;table", " touches "})
    EXPECT_TRUE(has(page, part)) << part;
  EXPECT_FALSE(has(page, "<b>table"));
}

TEST(ViewPage, OfAProgramNothingIsSaidOfSightAndNoZeroHasASign) {
  const Cell cell = cell_among(kObstacles);
  Viewed viewed = two_poses(cell);
  viewed.poses.erase(viewed.poses.begin());
  viewed.poses.front().measured = false;
  viewed.poses.front().context.q(4) = -1e-9;
  const std::string page = view_page(cell, viewed);
  EXPECT_TRUE(has(page, "All 1 poses are clear of what is stated, and inside the workspace."));
  EXPECT_FALSE(has(page, "in sight"));
  EXPECT_FALSE(has(page, ", -0.0"));
}

TEST(ViewPage, OfACellAloneItShowsTheRestPoseAndWhatIsNotStated) {
  const std::string page = view_page(cell_among(""), {});
  EXPECT_TRUE(has(page, "The cell alone, at its rest pose"));
  EXPECT_TRUE(has(page, "No obstacle is stated"));
}

TEST(ViewPage, IsDrawnInARealBrowserHoweverNarrow) {
  if (!test::has_browser()) GTEST_SKIP() << test::kBrowser << " is not installed";
  const Cell cell = cell_among(kObstacles);
  const std::string page = view_page(cell, two_poses(cell));
  for (const int width : {1200, 500}) {
    std::map<std::string, int> seen = test::seen_by_browser(page, width);
    EXPECT_EQ(seen["errors"], 0) << width;
    EXPECT_LE(seen["page-too-wide"], 0) << width;
    EXPECT_GT(seen["space"], 2000) << width;
  }
}

}  // namespace
}  // namespace trammel
