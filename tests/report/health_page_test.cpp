#include "server/report/health_page.h"

#include <gtest/gtest.h>

#include "tests/support/page_text.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

constexpr const char* kHostile = "<script>alert(1)</script>&\"'onload=x";
constexpr const char* kFindings =
    R"({"verdict": "cannot_tell", "why": "too <few>", "tolerance_mm": 0.1, "rms_mm": 0.02, "would_have_seen_mm": null,
        "due": "2026-12-01", "due_because": "it drifts", "model": "0123abcd", "changed": [{"cause": "gear_transmission",
        "joint": 3, "effect_rms_mm": 0.05, "u95": 0.01, "could_also_be": [{"cause": "tool", "joint": null}]}],
        "smallest_seen": [{"cause": "geometry", "joint": null, "parameter": "d4", "effect_rms_mm": null}]})";

TEST(HealthPage, SaysVerdictChangesAndWhenToCheckAgain) {
  const std::string page = health_sections(kFindings, "<p>links</p>");
  for (const char* part : {"<span class=\"badge soon\">cannot tell</span>too &lt;few&gt;",
                           "2026-12-01: it drifts", "gear ripple in joint 3", "0.0500 mm",
                           "tool position", "link geometry, d4</td><td>never", "<p>links</p>"})
    EXPECT_TRUE(test::has(page, part)) << part << "\n" << page;
}

TEST(HealthPage, DrawsThePosesAndListsWhatEachIsOffByTheWorstFirst) {
  const std::string page = health_sections(
      R"({"verdict": "healthy", "why": "as its model has it", "at_poses": [
        {"pose_id": "p<1>", "xyz_mm": [1000, 0, 500], "off_mm": [0.01, -0.02, 0.005], "expected_mm": 0.03, "suspect": false},
        {"pose_id": "p2", "xyz_mm": [500, 800, 900], "off_mm": [1.5, 0, 0], "expected_mm": 0.03, "suspect": true},
        {"pose_id": "p3", "xyz_mm": [1], "off_mm": null}]})",
      "");
  for (const char* part : {"<span class=\"badge good\">healthy</span>", "from above",
                           "from the side", "<title>p&lt;1&gt;: 0.0229 mm</title>",
                           "drawn 100 times as long", "fits nothing, left out", "-0.0200"})
    EXPECT_TRUE(test::has(page, part)) << part << "\n" << page;
  EXPECT_LT(page.find(">p2</td>"), page.find(">p&lt;1&gt;</td>")) << "the worst first";
  EXPECT_FALSE(test::has(page, ">p3</td>"));
}

TEST(HealthPage, OfWhatItCannotReadLeavesOut) {
  for (const char* findings :
       {"", "[]", "{\"changed\": 3, \"smallest_seen\": [7, null]}", "{\"verdict\": {}}"})
    EXPECT_TRUE(test::has(health_sections(findings, ""), "Nothing that these poses show."));
  EXPECT_FALSE(test::has(health_page("{}", {kHostile, kHostile}), "<script>"));
}

TEST(HealthPage, AsAPageOfItsOwnItIsDatedAndSaysOfWhichRobotAndModel) {
  const auto cell = parse_cell(
      test::small_cell_yaml("cell-3", "none") + "serial_number: 66-40\ninstrument: AT960\n",
      test::small_robot_yaml(), "cell-3.yaml");
  ASSERT_TRUE(cell);
  const std::string page = health_page(kFindings, {"cell-3", "few", 1'763'942'400, &*cell});
  for (const char* part : {"Health of cell cell-3", "checked 2025-11-24", "serial number 66-40",
                           "measured with AT960", "0123abcd", "batch few"})
    EXPECT_TRUE(test::has(page, part)) << part;
}

}  // namespace
}  // namespace trammel
