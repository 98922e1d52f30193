#include "server/measurement/files/csv_table.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

std::string refusal(const std::string& text) {
  const auto table = CsvTable::parse(text, "f.csv");
  return table ? "accepted" : table.error().message;
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
  const auto table = CsvTable::parse("# made by hand\n\na,b\n1,\"two\nlines\"\n  # more\n3,4\n", "f.csv");
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
  for (const std::string field : {"plain", "with, comma", "a \"quote\"", "two\nlines", " edge ", "# no comment", ""}) {
    const auto table = CsvTable::parse("a,b\n" + csv_field(field) + ",x\n", "f.csv");
    ASSERT_TRUE(table) << table.error().message;
    EXPECT_EQ(table->field(0, 0), field);
  }
}

TEST(CsvTable, RefusesWhatIsNoTableAndSaysWhere) {
  EXPECT_EQ(refusal(""), "f.csv: empty file, expected a header line with column names");
  EXPECT_EQ(refusal("# only a comment\n"), "f.csv: empty file, expected a header line with column names");
  EXPECT_EQ(refusal("a,b,a\n"), "f.csv row 1: column a appears twice");
  EXPECT_EQ(refusal("a,,b\n"), "f.csv row 1: column 2 has no name");
  EXPECT_EQ(refusal("a,b\n1,2\n1\n"), "f.csv row 3: 1 values, the header has 2 columns");
  EXPECT_EQ(refusal("a,b\n1,2,\n"), "f.csv row 2: 3 values, the header has 2 columns");
  EXPECT_EQ(refusal("a,b\n1,2,"), "f.csv row 2: 3 values, the header has 2 columns");
  EXPECT_EQ(refusal("a,b\n\"1,2\n"), "f.csv row 2: a quote is not closed");
  EXPECT_EQ(refusal("a,b\n\"1\"x,2\n"), "f.csv row 2: 'x' after a closing quote, expected ','");
}

TEST(CsvTable, RefusesBytesThatAreNoUtf8AndTakesThoseThatAre) {
  EXPECT_EQ(refusal("a\n\xB0\n"), "f.csv row 2: not UTF-8 text");
  EXPECT_EQ(refusal("a\n\xE2\x82\n"), "f.csv row 2: not UTF-8 text");
  EXPECT_EQ(refusal("a\n\xED\xA0\x80\n"), "f.csv row 2: not UTF-8 text");
  EXPECT_EQ(refusal("a\n\xC0\xAF\n"), "f.csv row 2: not UTF-8 text");
  EXPECT_EQ(refusal(std::string("a\n\0\n", 4)), "f.csv row 2: not UTF-8 text");
  EXPECT_EQ(refusal("a\n\xC2\xB0 \xE2\x82\xAC \xF0\x9F\xA4\x96\n"), "accepted");
}

TEST(CsvTable, ReadsNumbersWholeOrNotAtAll) {
  const auto table = CsvTable::parse("a\n+1.5\n-2e-3\n1.5mm\nnan\n-inf\n1e400\n2000\n \"\"\n0x10\n", "f.csv");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->number(0, 0).value(), 1.5);
  EXPECT_EQ(table->number(1, 0).value(), -2e-3);
  EXPECT_EQ(table->number(2, 0).error().message, "f.csv row 4: a is '1.5mm', expected a number");
  EXPECT_EQ(table->number(3, 0).error().message, "f.csv row 5: a is nan, expected a finite number");
  EXPECT_EQ(table->number(4, 0).error().message, "f.csv row 6: a is -inf, expected a finite number");
  EXPECT_EQ(table->number(5, 0, 1000).error().message, "f.csv row 7: a is 1e400, limit 1000");
  EXPECT_EQ(table->number(6, 0, 1000).error().message, "f.csv row 8: a is 2000, limit 1000");
  EXPECT_EQ(table->number(7, 0).error().message, "f.csv row 9: a is empty, expected a number");
  EXPECT_FALSE(table->number(8, 0));
}

TEST(CsvTable, ReadsWholeNumbersWithinTheirLimits) {
  const auto table = CsvTable::parse("a\n7\n8\n1.5\n", "f.csv");
  ASSERT_TRUE(table);
  EXPECT_EQ(table->integer(0, 0, 0, 7).value(), 7);
  EXPECT_EQ(table->integer(1, 0, 0, 7).error().message, "f.csv row 3: a is 8, expected a whole number from 0 to 7");
  EXPECT_FALSE(table->integer(2, 0, 0, 7));
}

TEST(CsvTable, SaysThatSemicolonsAreNoSeparators) {
  const auto table = CsvTable::parse("a;b\n1;2\n", "f.csv");
  ASSERT_TRUE(table);
  EXPECT_EQ(table->require("a").error().message,
            "f.csv: missing column a; the header has: a;b (columns must be separated by ',')");
}

}  // namespace
}  // namespace trammel
