#include "server/report/html.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

TEST(Html, TextStaysText) { EXPECT_EQ(html_text("<b> & \"x\""), "&lt;b&gt; &amp; &quot;x&quot;"); }

TEST(Html, WhatControlsATerminalIsSpelledOut) {
  EXPECT_EQ(html_text("a\x1b[31m\nb"), "a\\u001b[31m\nb");
}

TEST(Html, ATableHasACellForEachTextAndARowSaysWhatItIs) {
  const HtmlTable table = {
      .kind = "k",
      .head = {"a", "b"},
      .rows = {{.cells = {"1", "2"}}, {.cells = {"", "3"}, .kind = "wide", .last_spans = 2}}};
  EXPECT_EQ(html_table(table),
            "<table "
            "class=\"k\">\n<thead><tr><th>a</th><th>b</th></tr></thead>\n<tbody>\n<tr><td>1</"
            "td><td>2</td></tr>\n"
            "<tr class=\"wide\"><td></td><td colspan=\"2\">3</td></tr>\n</tbody></table>");
}

TEST(Html, OfATableThatStacksEachCellSaysItsColumnAndOfOneThatFlowsAllButTheFirst) {
  EXPECT_NE(html_table({"k stacks", {"a", "b", ""}, {{{"1", "2", "3"}}}})
                .find("<td data-name=\"a\">1</td><td data-name=\"b\">2</td><td>3</td>"),
            std::string::npos);
  EXPECT_NE(html_table({"flows", {"a", "b"}, {{{"1", "2"}}}})
                .find("<td>1</td><td data-name=\"b\">2</td>"),
            std::string::npos);
}

TEST(Html, ATableWithoutNamesHasNoRowOfThem) {
  EXPECT_EQ(html_table({"k", {}, {{{"1"}}}}), "<table class=\"k\">\n<tr><td>1</td></tr>\n</table>");
}

TEST(Html, NoTextEndsTheScriptThatHoldsIt) {
  EXPECT_EQ(script_json({{"a", "</script>"}}), R"({"a":"\u003c/script>"})");
}

TEST(Html, APageIsFilledInOnceAndContentsAreNotReadAgain) {
  EXPECT_EQ(fill_in("{{a}} and {{b}}, {{a}}", {{"a", "{{b}}"}, {"b", "2"}}), "{{b}} and 2, {{b}}");
  EXPECT_EQ(fill_in("nothing", {}), "nothing");
}

TEST(HtmlDeathTest, ANameWithoutContentIsABug) {
  EXPECT_DEATH((void)fill_in("{{a}}", {}), "content");
}

}  // namespace
}  // namespace trammel
