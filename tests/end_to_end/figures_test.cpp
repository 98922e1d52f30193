// The figures that are claimed are checked against what the programs print.
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <sstream>
#include <string>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

const std::string kFolder = std::string(TRAMMEL_SOURCE_DIR) + "/tests/benchmarks/";

std::string table() {
  std::ifstream file(kFolder + "README.md");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// The short study's rows, by the programs under test, against `figures`.
test::Finished checked_against(const std::string& figures) {
  const test::TemporaryFolder folder;
  return test::run({"/usr/bin/env", "TRAMMEL_BUILD=" TRAMMEL_BINARY_DIR,
                    "TRAMMEL_FIGURES=" + folder.write("table.md", figures), kFolder + "figures", "1dim, M2"},
                   std::chrono::minutes(4));
}

TEST(Figures, AreAsTheTableSays) {
  const test::Finished asked = checked_against(table());
  EXPECT_EQ(asked.exit_code, 0) << asked.out << asked.err;
  EXPECT_NE(asked.out.find("3 figures checked, 0 missed"), std::string::npos) << asked.out;
}

TEST(Figures, ThatAreMissedEndWith1AndAreNamed) {
  const std::string better = std::regex_replace(table(), std::regex("(1dim, M2, mm \\|) [0-9.]+"), "$1 0.0133");
  ASSERT_NE(better, table());
  const test::Finished asked = checked_against(better);
  EXPECT_EQ(asked.exit_code, 1) << asked.out << asked.err;
  EXPECT_NE(asked.out.find("MISSED  1dim, M2, mm"), std::string::npos) << asked.out;
  EXPECT_NE(asked.out.find("3 figures checked, 1 missed"), std::string::npos) << asked.out;
}

TEST(Figures, AnAimThatIsNotReachedMustBeSaidInItsRow) {
  const std::string bold =
      std::regex_replace(table(), std::regex("(1dim, M2, mm \\|[^|]*\\|[^|]*\\|) at most [0-9.]+"), "$1 at most 0.01");
  ASSERT_NE(bold, table());
  EXPECT_EQ(checked_against(bold).exit_code, 1);
  const std::string honest = std::regex_replace(bold, std::regex("at most 0\\.01 "), "at most 0.01, not reached ");
  EXPECT_EQ(checked_against(honest).exit_code, 0) << checked_against(honest).out;
}

}  // namespace
}  // namespace trammel
