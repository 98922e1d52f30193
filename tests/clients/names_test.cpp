#include "clients/cli/terminal/names.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>

#include "clients/cli/command_line.h"
#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/defaults.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

using Words = std::vector<std::string>;

class Names : public testing::Test {
 protected:
  Names() { make_command_line(app_, chosen_); }

  [[nodiscard]] Words by_option(const Words& words) const {
    return words_by_option(app_, words, false);
  }
  /// True if the command line takes the words.
  static bool takes(const Words& words) {
    CLI::App app("", "trammel");
    Action chosen;
    make_command_line(app, chosen);
    Words all = words_by_option(app, words, false);
    try {
      app.parse(Words(all.rbegin(), all.rend()));
    } catch (const CLI::ParseError&) {
      return false;
    }
    return static_cast<bool>(chosen);
  }

  CLI::App app_{"", "trammel"};
  Action chosen_;
  test::TemporaryFolder folder_;
};

TEST_F(Names, AWordBehindACommandNamesTheCellTheVersionTheBatchOrTheJob) {
  for (const auto& [bare, said] : std::vector<std::pair<Words, Words>>{
           {{"activate", "cell-7@3"}, {"activate", "--service", "--model", "cell-7@3"}},
           {{"rollback", "cell-7"}, {"rollback", "--cell", "cell-7"}},
           {{"models", "cell-7"}, {"models", "--cell", "cell-7"}},
           {{"watch", "12"}, {"watch", "--job", "12"}},
           {{"cancel", "12"}, {"cancel", "--job", "12"}},
           {{"discard", "cell-7", "b2"}, {"discard", "--cell", "cell-7", "--batch", "b2"}},
           {{"submit", "c", "b.csv", "--watch"},
            {"submit", "--cell", "c", "--batch", "b.csv", "--watch"}},
           {{"train", "c.yaml", "a.csv", "b.csv", "-o", "m"},
            {"train", "--cell", "c.yaml", "--batch", "a.csv", "--batch", "b.csv", "-o", "m"}},
           {{"predict", "m", "--joints", "j.csv"},
            {"predict", "--model", "m", "--joints", "j.csv"}},
           {{"correct", "m", "a.mod", "b.mod", "-o", "out"},
            {"correct", "--model", "m", "a.mod", "b.mod", "-o", "out"}}})
    EXPECT_EQ(by_option(bare), said);
}

TEST_F(Names, WhatAnOptionSaysTakesNoBareWordInEitherOrder) {
  EXPECT_EQ(by_option({"correct", "a.mod", "--model", "m", "-o", "out"}),
            (Words{"correct", "a.mod", "--model", "m", "-o", "out"}));
  EXPECT_EQ(by_option({"discard", "b2", "--cell=cell-7"}),
            (Words{"discard", "--batch", "b2", "--cell=cell-7"}));
  EXPECT_EQ(by_option({"train", "--batch", "b.csv", "c.yaml", "-o", "m"}),
            (Words{"train", "--batch", "b.csv", "--cell", "c.yaml", "-o", "m"}));
  EXPECT_EQ(by_option({"correct", "--undo", "a.mod", "b.mod", "-o", "d"}),
            (Words{"correct", "--undo", "a.mod", "b.mod", "-o", "d"}))
      << "undoing needs no model";
}

TEST_F(Names, AVersionIsAskedOfAServiceWithoutSayingSo) {
  EXPECT_EQ(by_option({"report", "cell-7@3", "-o", "p"}),
            (Words{"report", "--service", "--model", "cell-7@3", "-o", "p"}));
  EXPECT_EQ(by_option({"compare", "cell-7@2", "new.model"}),
            (Words{"compare", "--service", "cell-7@2", "new.model"}));
  const std::string file = folder_.write("cell-7@3", "");
  EXPECT_EQ(by_option({"report", file, "-o", "p"}), (Words{"report", "--model", file, "-o", "p"}))
      << "a file is called so";
}

TEST_F(Names, EveryCommandTakesWhatItNamesWithoutAnOption) {
  for (const Words& words : std::vector<Words>{
           {"activate", "c@3"},   {"rollback", "c"},      {"show", "c@3"},
           {"models", "c"},       {"jobs", "c"},          {"batches", "c"},
           {"watch", "1"},        {"cancel", "1"},        {"release", "c", "b"},
           {"discard", "c", "b"}, {"submit", "c", "b"},   {"retrain", "c", "b1", "b2"},
           {"audit", "c"},        {"check", "m", "b"},    {"diagnose", "c", "b"},
           {"compare", "a", "b"}, {"evaluate", "m", "b"}, {"remedies", "m"},
           {"replay", "c@2"},     {"import", "c", "m"}})
    EXPECT_TRUE(takes(words)) << words.front();
  for (Words words : std::vector<Words>{{"export", "c@3"},
                                        {"export-robot", "m"},
                                        {"history", "c"},
                                        {"report", "m"},
                                        {"plan", "c", "--count", "5"},
                                        {"predict", "m", "p.mod"},
                                        {"correct", "m", "p.mod"},
                                        {"train", "c", "b"}}) {
    words.insert(words.end(), {"-o", "out"});
    EXPECT_TRUE(takes(words)) << words.front();
  }
}

TEST_F(Names, TheCellOfTheDefaultsNeedNotBeNamed) {
  const std::string defaults = folder_.write("defaults", "cell = cell-8\n");
  EXPECT_EQ(with_defaults(app_, {"submit", "b.csv"}, defaults).value(),
            (Words{"submit", "--batch", "b.csv", "--cell", "cell-8"}));
  EXPECT_EQ(with_defaults(app_, {"submit", "cell-7", "b.csv"}, defaults).value(),
            (Words{"submit", "--cell", "cell-7", "--batch", "b.csv"}));
  EXPECT_EQ(with_defaults(app_, {"models", "cell-7"}, defaults).value(),
            (Words{"models", "--cell", "cell-7"}));
}

TEST_F(Names, ACellIsNoVersionOfIt) {
  const auto refused = cell_id("cell-7@3");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUsage);
  EXPECT_NE(refused.error().next.find("trammel activate CELL@VERSION"), std::string::npos);
}

}  // namespace
}  // namespace trammel::cli
