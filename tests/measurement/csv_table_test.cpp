#include "server/measurement/files/csv_table.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Refusal refusal_table(const std::string& text) {
  const auto table = CsvTable::parse(text, "f.csv");
  return refusal_of(table);
}

TEST(CsvTable, ReadsTheSameRowsFromLfAndCrlfWithAndWithoutByteOrderMark) {
  for (const std::string text : {"a,b\n1,2\n3,4\n", "a,b\r\n1,2\r\n3,4\r\n",
                                 "\xEF\xBB\xBF"
                                 "a,b\n1,2\n3,4"}) {
    const auto table = CsvTable::parse(text, "f.csv");
    ASSERT_TRUE(table) << table.error().message;
    EXPECT_EQ(table->columns(), (std::vector<std::string>{"a", "b"}));
    ASSERT_EQ(table->size(), 2u);
    EXPECT_EQ(table->field(1, 1), "4");
  }
}

TEST(CsvTable, NamesTheLineInTheFileAfterCommentsBlankLinesAndQuotedLineEnds) {
  const auto table =
      CsvTable::parse("# made by hand\n\na,b\n1,\"two\nlines\"\n  # more\n3,4\n", "f.csv");
  ASSERT_TRUE(table) << table.error().message;
  ASSERT_EQ(table->size(), 2u);
  EXPECT_EQ(table->line(0), 4);
  EXPECT_EQ(table->line(1), 7);
  EXPECT_EQ(table->field(0, 1), "two\nlines");
}

TEST(CsvTable, UnderstandsQuotedSeparatorsAndDoubledQuotes) {
  const auto table = CsvTable::parse("a,b\n\"x, \"\"y\"\"\" , z \n", "f.csv");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->field(0, 0), "x, \"y\"");
  EXPECT_EQ(table->field(0, 1), "z");
}

TEST(CsvTable, WrittenFieldsReadBackAsTheyWere) {
  for (const std::string field :
       {"plain", "with, comma", "a \"quote\"", "two\nlines", " edge ", "# no comment", ""}) {
    const auto table = CsvTable::parse("a,b\n" + csv_field(field) + ",x\n", "f.csv");
    ASSERT_TRUE(table) << table.error().message;
    EXPECT_EQ(table->field(0, 0), field);
  }
}

TEST(CsvTable, RefusesWhatIsNoTableAndSaysWhere) {
  EXPECT_EQ(refusal_table(""), Refusal("f.csv").beyond(0, 1));
  EXPECT_EQ(refusal_table("# only a comment\n"), Refusal("f.csv").beyond(0, 1));
  EXPECT_EQ(refusal_table("a,b,a\n"), Refusal("f.csv", 1, "a"));
  EXPECT_EQ(refusal_table("a,,b\n"), Refusal("f.csv", 1).value(2));
  EXPECT_EQ(refusal_table("a,b\n1,2\n1\n"), Refusal("f.csv", 3).beyond(1, 2));
  EXPECT_EQ(refusal_table("a,b\n1,2,\n"), Refusal("f.csv", 2).beyond(3, 2));
  EXPECT_EQ(refusal_table("a,b\n1,2,"), Refusal("f.csv", 2).beyond(3, 2));
  EXPECT_EQ(refusal_table("a,b\n\"1,2\n"), Refusal("f.csv", 2));
  EXPECT_EQ(refusal_table("a,b\n\"1\"x,2\n"), Refusal("f.csv", 2));
}

TEST(CsvTable, RefusesBytesThatAreNoUtf8AndTakesThoseThatAre) {
  EXPECT_EQ(refusal_table("a\n\xB0\n"), Refusal("f.csv", 2));
  EXPECT_EQ(refusal_table("a\n\xE2\x82\n"), Refusal("f.csv", 2));
  EXPECT_EQ(refusal_table("a\n\xED\xA0\x80\n"), Refusal("f.csv", 2));
  EXPECT_EQ(refusal_table("a\n\xC0\xAF\n"), Refusal("f.csv", 2));
  EXPECT_EQ(refusal_table(std::string("a\n\0\n", 4)), Refusal("f.csv", 2));
  EXPECT_EQ(refusal_table("a\n\xC2\xB0 \xE2\x82\xAC \xF0\x9F\xA4\x96\n"), Refusal::none());
}

TEST(CsvTable, ReadsNumbersWholeOrNotAtAll) {
  const auto table =
      CsvTable::parse("a\n+1.5\n-2e-3\n1.5mm\nnan\n-inf\n1e400\n2000\n \"\"\n0x10\n", "f.csv");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->number(0, 0).value(), 1.5);
  EXPECT_EQ(table->number(1, 0).value(), -2e-3);
  EXPECT_EQ(refusal_of(table->number(2, 0)), Refusal("f.csv", 4, "a").text("1.5mm"));
  EXPECT_EQ(refusal_of(table->number(3, 0)), Refusal("f.csv", 5, "a").text("nan"));
  EXPECT_EQ(refusal_of(table->number(4, 0)), Refusal("f.csv", 6, "a").text("-inf"));
  EXPECT_EQ(
      refusal_of(table->number(5, 0, 1000)),
      Refusal("f.csv", 7, "a").beyond(std::numeric_limits<double>::infinity(), 1000).text("1e400"));
  EXPECT_EQ(refusal_of(table->number(6, 0, 1000)), Refusal("f.csv", 8, "a").beyond(2000, 1000));
  EXPECT_EQ(refusal_of(table->number(7, 0)), Refusal("f.csv", 9, "a"));
  EXPECT_FALSE(table->number(8, 0));
}

TEST(CsvTable, ReadsWholeNumbersWithinTheirLimits) {
  const auto table = CsvTable::parse("a\n7\n8\n1.5\n", "f.csv");
  ASSERT_TRUE(table);
  EXPECT_EQ(table->integer(0, 0, 0, 7).value(), 7);
  EXPECT_EQ(refusal_of(table->integer(1, 0, 0, 7)), Refusal("f.csv", 3, "a").beyond(8, 7));
  EXPECT_FALSE(table->integer(2, 0, 0, 7));
}

TEST(CsvTable, NamesTheColumnThatWasMeant) {
  const auto table = CsvTable::parse("q1_dge,x_m,Y_MM\n1,2,3\n", "f.csv");
  ASSERT_TRUE(table);
  EXPECT_EQ(refusal_of(table->require("q1_deg")), Refusal("f.csv", {}, "q1_deg"));
  EXPECT_NE(table->require("q1_deg").error().next.find("q1_dge"), std::string::npos);
  EXPECT_NE(table->require("x_mm").error().next.find("x_m"), std::string::npos);
  EXPECT_EQ(table->require("y_mm").value(), 2u) << "upper and lower case are the same name";
  const auto next_of = [](const char* header) {
    const auto other = CsvTable::parse(header, "f.csv");
    return other ? other->require("x_mm").error().next : other.error().next;
  };
  const std::string both = next_of("x_nom_mm,x_meas_mm\n");
  EXPECT_NE(both.find("x_nom_mm or x_meas_mm"), std::string::npos) << both;
  for (const char* one : {"x_mm|y_mm|z_mm\n", "x_mm y_mm z_mm\n"})
    EXPECT_NE(next_of(one).find("separate names and values"), std::string::npos) << next_of(one);
}

TEST(CsvTable, SaysHowATextBecomesANumberAndATitleAComment) {
  const auto table =
      CsvTable::parse("x_mm;y_mm\n1\u00a0840,774;\u22125\n1'840.5;7 mm\n1e9;0\n", "f.csv");
  ASSERT_TRUE(table) << sentence(table.error());
  const auto next_of = [&](std::size_t row, std::size_t column) {
    return table->number(row, column, 1e6).error().next;
  };
  for (const std::size_t row : {0, 1})
    EXPECT_NE(next_of(row, 0).find("separates thousands"), std::string::npos) << next_of(row, 0);
  EXPECT_NE(next_of(0, 1).find("minus"), std::string::npos) << next_of(0, 1);
  EXPECT_NE(next_of(1, 1).find("digits alone"), std::string::npos) << next_of(1, 1);
  EXPECT_NE(next_of(2, 0).find("another unit"), std::string::npos) << next_of(2, 0);
  const auto titled = CsvTable::parse("Report of Monday\nx_mm,y_mm\n1,2\n", "f.csv");
  EXPECT_EQ(refusal_of(titled), Refusal("f.csv", 2).beyond(2, 1));
  EXPECT_NE(titled.error().next.find("'Report of Monday'"), std::string::npos)
      << titled.error().next;
  EXPECT_FALSE(CsvTable::parse("x_mm,y_mm\r1,2\r", "f.csv")) << "line ends of old programs";
}

}  // namespace
}  // namespace trammel
