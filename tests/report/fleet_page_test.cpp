#include "server/report/fleet_page.h"

#include <gtest/gtest.h>

#include "tests/support/page_text.h"

namespace trammel {
namespace {

using nlohmann::ordered_json;

TEST(FleetPage, SaysOfEachCellItsHealthItsNextCheckAndWhatItsTwinsSay) {
  const ordered_json fleet = ordered_json::parse(
      R"({"cells": [{"cell": "a<b>", "version": 3, "robot": "R", "model": "0123", "health": {"verdict": "cannot_tell",
          "due": "2026-12-01"}, "unlike_twins": [{"sentence": "a2 is 0.3 mm longer"}],
          "lines_among_sisters": [{"differs": true, "sentence": "the zero of joint 4 is off"},
          {"differs": false, "sentence": "the zero of joint 5 is not"}]},
          {"cell": "b", "version": null, "health": {"verdict": "changed"}, "unlike_twins": [],
           "need": {"urgency": "now", "sentence": "The robot has changed: <joint> 3.", "action": "measure it anew"}},
          {"cell": "c", "version": null, "health": null}], "types": [{"robot": "R", "robots": 3}]})");
  const std::string page = fleet_page(fleet, 1'763'942'400);
  for (const char* part :
       {"a&lt;b&gt;", "0123 (version 3)", "cannot tell", "2026-12-01", "a2 is 0.3 mm longer",
        "like its twins", "not checked yet", "no model in force", "R: 3 robots", "2025-11-24",
        "3 robots: 1 changed, 1 not checked yet.",
        "<span class=\"badge bad\">act now</span>The robot has changed: &lt;joint&gt; 3. "
        "<b>To do:</b> measure it anew"})
    EXPECT_TRUE(test::has(page, part)) << part << "\n" << page;
  EXPECT_TRUE(test::has(page, "the zero of joint 4 is off"));
  EXPECT_FALSE(test::has(page, "the zero of joint 5 is not"));
}

TEST(FleetPage, OfWhatItCannotReadLeavesOut) {
  for (const char* fleet :
       {"null", "[]", R"({"cells": [7, null, {"health": 3, "unlike_twins": [1]}], "types": [2]})"})
    EXPECT_TRUE(test::has(fleet_page(ordered_json::parse(fleet), 0), "not checked yet")) << fleet;
}

}  // namespace
}  // namespace trammel
