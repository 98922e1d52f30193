// The figures that are claimed are checked against what the programs print.
#include <gtest/gtest.h>

#include <string>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

const std::string kFigures = std::string(TRAMMEL_SOURCE_DIR) + "/tests/benchmarks/figures";

TEST(Figures, AreAsTheTableSays) {
  const test::Finished asked =
      test::run({"/usr/bin/env", "TRAMMEL_BUILD=" TRAMMEL_BINARY_DIR, kFigures, "1dim, M2, mm"},
                std::chrono::minutes(4));
  EXPECT_EQ(asked.exit_code, 0) << asked.out << asked.err;
  EXPECT_NE(asked.out.find("1 figures checked, 0 missed"), std::string::npos) << asked.out;
}

/// A table of one row, of a figure that its command prints as 0.0233.
test::Finished checked(const std::string& figure, const std::string& check,
                       const std::string& aim) {
  const test::TemporaryFolder folder;
  const std::string table =
      "| name | figure | check | aim | printed as | time | command "
      "|\n|---|---|---|---|---|---|---|\n| gap, mm | " +
      figure + " | " + check + " | " + aim + " | | s | `echo figure gap, mm: 0.0233` |\n";
  return test::run(
      {"/usr/bin/env", "TRAMMEL_FIGURES=" + folder.write("table.md", table), kFigures});
}

TEST(Figures, ThatAreMissedEndWith1AndAreNamed) {
  EXPECT_EQ(checked("0.0230", "within 2 %", "").exit_code, 0);
  const test::Finished missed = checked("0.0220", "within 2 %", "");
  EXPECT_EQ(missed.exit_code, 1);
  EXPECT_NE(missed.out.find("MISSED  gap, mm"), std::string::npos) << missed.out;
  EXPECT_EQ(checked("0.02", "at most 0.023", "").exit_code, 1);
  EXPECT_EQ(checked("0.02", "at least 0.023", "").exit_code, 0);
}

TEST(Figures, WhoseAimIsNotReachedMustSaySo) {
  EXPECT_EQ(checked("0.0233", "within 2 %", "at most 0.02").exit_code, 1);
  EXPECT_EQ(checked("0.0233", "within 2 %", "at most 0.02, not reached").exit_code, 0);
  EXPECT_EQ(checked("0.0233", "within 2 %", "at most 0.03").exit_code, 0);
}

TEST(Figures, ThatACommandDoesNotPrintAreMissed) {
  const test::TemporaryFolder folder;
  const std::string table =
      folder.write("table.md",
                   "| name | figure | check | aim | printed as | time | command |\n| gap, mm | 1 | "
                   "within 1 | | | s | `false` |\n");
  EXPECT_EQ(test::run({"/usr/bin/env", "TRAMMEL_FIGURES=" + table, kFigures}).exit_code, 1);
}

}  // namespace
}  // namespace trammel
