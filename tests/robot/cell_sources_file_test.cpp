#include "server/robot/cell_sources_file.h"

#include <gtest/gtest.h>

#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

const std::vector<std::string> kExtended = {"base", "geometry", "gear_transmission:3@48.5"};

std::string extended(const std::string& text) {
  return with_error_sources(text, kExtended, "cell.yaml").value();
}

TEST(CellSources, ReplaceTheListAndNothingElse) {
  EXPECT_EQ(extended("# a\ncell: c   # b\nmodel: {error_sources: [base,  # why\n  geometry], bias: "
                     "se}  # d\nx: 1\n"),
            "# a\ncell: c   # b\nmodel: {error_sources: [base, geometry, "
            "gear_transmission:3@48.5], bias: se}  # d\nx: 1\n");
}

TEST(CellSources, ReplaceAListOfLines) {
  EXPECT_EQ(extended("model:\n  error_sources:\n    - base\n    # and\n    - geometry\n  bias: se  "
                     " # kept\nx: 1\n"),
            "model:\n  error_sources:\n    - base\n    - geometry\n    - "
            "gear_transmission:3@48.5\n  bias: se   # kept\nx: 1\n");
}

TEST(CellSources, AreAddedWhereTheFileLeavesThemToTheDefault) {
  EXPECT_EQ(
      extended("cell: c\nmodel: {bias: se}\n"),
      "cell: c\nmodel: {error_sources: [base, geometry, gear_transmission:3@48.5], bias: se}\n");
  EXPECT_EQ(
      extended("cell: c\nmodel:\n  bias: se\n"),
      "cell: c\nmodel:\n  error_sources: [base, geometry, gear_transmission:3@48.5]\n  bias: se\n");
  EXPECT_EQ(extended("cell: c"),
            "cell: c\nmodel: {error_sources: [base, geometry, gear_transmission:3@48.5]}\n");
}

TEST(CellSources, OfTheShippedCellsChangeOneLine) {
  for (const char* name : {"/config/cell-7.yaml", "/config/ur10.yaml"}) {
    const std::string before = test::read_file(TRAMMEL_SOURCE_DIR + std::string(name));
    const std::string after = extended(before);
    const auto lines = [](const std::string& text) {
      return std::count(text.begin(), text.end(), '\n');
    };
    EXPECT_EQ(lines(before), lines(after));
    const std::string list = "[base, geometry, compliance]";
    const std::size_t at = before.find(list);
    EXPECT_EQ(after.substr(0, at), before.substr(0, at));
    EXPECT_TRUE(after.ends_with(before.substr(at + list.size())));
  }
}

TEST(CellSources, OfAnAliasAreRefusedInsteadOfChangedElsewhere) {
  const auto edited = with_error_sources("list: &l [base]\nmodel: {error_sources: *l, bias: se}\n",
                                         kExtended, "c.yaml");
  ASSERT_FALSE(edited);
  EXPECT_EQ(refusal_of(edited), Refusal("c.yaml", {}, "model: error_sources"));
}

}  // namespace
}  // namespace trammel
