#include "server/report/pages_beside.h"

#include <gtest/gtest.h>

#include "server/report/plain_page.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

bool has(const std::string& page, const std::string& part) {
  return page.find(part) != std::string::npos;
}

std::string page_of(std::string_view kind, const std::string& cell, const std::string& model = "") {
  return plain_page(
      {.mark = {kind, cell, model}, .title = "A page", .subtitle = "", .body = "<p>body</p>"});
}

class PagesBeside : public testing::Test {
 protected:
  std::string linked(std::string_view kind, const std::string& cell,
                     const std::string& file = "new.html") {
    return with_pages_beside(page_of(kind, cell), folder_.file(file));
  }
  test::TemporaryFolder folder_;
};

TEST_F(PagesBeside, APageLinksToThoseOfItsCellThatAreThereAndToNothingElse) {
  folder_.write("m.html", page_of("model", "cell-7", "0123abcd"));
  folder_.write("d.html", page_of("diagnosis", "cell-7"));
  folder_.write("other.html", page_of("model", "cell-8"));
  folder_.write("foreign.html", "<html><a href=\"x\">model</a></html>");
  folder_.write("new.html", page_of("program", "cell-7"));
  const std::string page = linked("program", "cell-7");
  EXPECT_TRUE(has(page, "<a href=\"./m.html\">model 0123abcd (m.html)</a>")) << page;
  EXPECT_TRUE(has(page, "<a href=\"./d.html\">diagnosis (d.html)</a>"));
  for (const char* absent : {"other.html", "foreign.html", "./new.html"})
    EXPECT_FALSE(has(page, absent)) << absent;
}

TEST_F(PagesBeside, PagesThatWereThereLeadToANewOneAndNothingElseOfThemChanges) {
  const std::string before = with_pages_beside(page_of("model", "cell-7"), folder_.file("m.html"));
  const std::string model = folder_.write("m.html", before);
  const std::string other = folder_.write("other.html", page_of("model", "cell-8"));
  const std::string foreign = folder_.write("foreign.html", "<nav class=\"beside\"></nav>");
  const std::string page = linked("health", "cell-7");
  folder_.write("new.html", page);
  link_pages_beside(page, folder_.file("new.html"));
  const std::string link = "<a href=\"./new.html\">health (new.html)</a>\n";
  std::string after = test::read_file(model);
  EXPECT_TRUE(has(after, link)) << after;
  after.erase(after.find("Beside this page: " + link), 18 + link.size());
  EXPECT_EQ(after, before);
  EXPECT_EQ(test::read_file(other), page_of("model", "cell-8"));
  EXPECT_EQ(test::read_file(foreign), "<nav class=\"beside\"></nav>");
  link_pages_beside(page, folder_.file("new.html"));
  EXPECT_EQ(test::read_file(model).find(link), test::read_file(model).rfind(link)) << "once";
}

TEST_F(PagesBeside, AFleetLinksToThePagesOfAllItsCellsAndTheyToIt) {
  folder_.write("m.html", page_of("model", "cell-7"));
  folder_.write("n.html", page_of("model", "cell-8"));
  const std::string fleet = linked("fleet", "", "fleet.html");
  EXPECT_TRUE(has(fleet, "model of cell-7 (m.html)"));
  EXPECT_TRUE(has(fleet, "model of cell-8 (n.html)"));
  folder_.write("fleet.html", fleet);
  EXPECT_TRUE(has(linked("model", "cell-7"), "<a href=\"./fleet.html\">fleet (fleet.html)</a>"));
}

TEST_F(PagesBeside, NoFileNameAndNoMarkGetsIntoThePageAsMoreThanText) {
  const std::string hostile = "cell <script>alert(1)</script>\"";
  folder_.write("javascript:alert(1).html", page_of("model", hostile));
  folder_.write("a\"onclick=\"x.html", page_of("model", hostile, "<b>\""));
  folder_.write(
      "unclosed.html",
      "<meta name=\"trammel-page\" content=\"model\" data-cell=\"\" data-model=\"<script>\">");
  const std::string page = linked("diagnosis", hostile);
  EXPECT_TRUE(has(page, "<a href=\"./javascript%3Aalert%281%29.html\">")) << page;
  EXPECT_TRUE(has(page, "<a href=\"./a%22onclick%3D%22x.html\">"));
  EXPECT_FALSE(has(page, "<script>"));
  EXPECT_FALSE(has(page, "<b>"));
  EXPECT_FALSE(has(page, "unclosed"));
}

TEST_F(PagesBeside, WithoutAFolderOrAMarkAPageStaysAsItIs) {
  EXPECT_EQ(with_pages_beside(page_of("model", "c"), "-"), page_of("model", "c"));
  EXPECT_EQ(with_pages_beside("<p>no mark</p>", folder_.file("x.html")), "<p>no mark</p>");
  EXPECT_EQ(linked("model", "alone"), page_of("model", "alone"));
}

}  // namespace
}  // namespace trammel
