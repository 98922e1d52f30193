#include "clients/cli/terminal/table.h"

#include <gtest/gtest.h>

#include <sstream>

#include "clients/cli/terminal/output.h"

namespace trammel::cli {
namespace {

TEST(Table, HasAtMost100ColumnsAndLosesNoWordOfItsLastOne) {
  const std::string why =
      "not in force: on 40 poses held out it is worse than version 2, 0.0251 mm after 0.0112 mm, "
      "and the batch differs from those before it in the tool";
  const std::string text = table_text(
      {{"job", true}, {"cell"}, {"hash", false, true}, {"what"}},
      {{"7", "cell-7", "3f2a", why}, {"12", "a-cell-with-a-long-name", "9e1b", "in force"}},
      TableForm::kTable);
  std::istringstream lines(text), words(why);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100u) << line;
  for (std::string word; words >> word;) EXPECT_NE(text.find(word), std::string::npos) << word;
  EXPECT_EQ(text.find("3f2a"), std::string::npos) << "of the wide one";
  EXPECT_NE(text.find("\n 12  a-cell-with-a-long-name  in force\n"), std::string::npos) << text;
}

TEST(Table, IsALineARowWithEveryColumnWhereItIsWide) {
  const std::string last(120, 'x');
  EXPECT_EQ(table_text({{"cell"}, {"hash", false, true}, {"what"}}, {{"a", "3f2a", last}},
                       TableForm::kWide),
            "cell  hash  what\na     3f2a  " + last + "\n");
}

TEST(Output, OnATerminalTheStateOfALineIsSeenByItsColour) {
  EXPECT_EQ(painted("healthy: as it was\nnext check: soon\nchanged: joint 3\n"),
            "\033[32mhealthy: as it was\033[0m\nnext check: soon\n\033[31mchanged: joint "
            "3\033[0m\n");
}

}  // namespace
}  // namespace trammel::cli
