// The lines that the README tells somebody new to type do what it says.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// The blocks of commands (lines that are indented by four blanks) below `heading` of the README;
/// "" is what stands before the first.
std::vector<std::vector<std::string>> commands_below(const std::string& heading) {
  std::ifstream readme(fs::path(TRAMMEL_SOURCE_DIR) / "README.md");
  std::vector<std::vector<std::string>> blocks;
  bool here = heading.empty(), in_block = false;
  for (std::string line; std::getline(readme, line);) {
    if (line.starts_with("## ")) here = line == "## " + heading;
    const bool command = here && line.starts_with("    ");
    if (command && !in_block) blocks.emplace_back();
    if (command) blocks.back().push_back(line.substr(4));
    in_block = command;
  }
  return blocks;
}

/// A clone whose release build is the build under test.
fs::path built_clone(const test::TemporaryFolder& folder) {
  const fs::path clone = folder.path() / "trammel";
  fs::create_directories(clone / "build");
  for (const char* shipped : {"config", "models"}) {
    fs::create_directory_symlink(fs::path(TRAMMEL_SOURCE_DIR) / shipped, clone / shipped);
  }
  fs::create_directory_symlink(TRAMMEL_BINARY_DIR, clone / "build/release");
  return clone;
}

TEST(Readme, TheFiveLinesRunAsTheyStandOnABuiltClone) {
  const auto blocks = commands_below("Try it");
  ASSERT_EQ(blocks.size(), 1U);
  ASSERT_EQ(blocks[0].size(), 5U);
  const test::TemporaryFolder folder;
  const fs::path clone = built_clone(folder);
  std::string script = "set -euo pipefail\ncd '" + clone.string() + "'\n";
  for (const std::string& line : blocks[0]) script += line + "\n";
  const test::Finished run = test::run({"/bin/bash", "-c", script}, std::chrono::minutes(4));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string corrected = text_of(clone / "build/corrected.csv");
  std::istringstream lines(corrected);
  int holes = 0;
  for (std::string line; std::getline(lines, line);)
    holes += line.find(",ok,") != std::string::npos ? 1 : 0;
  EXPECT_EQ(holes, 35) << corrected;
}

TEST(Readme, LeadsWithTheTwoCommandsEachAloneOnItsLine) {
  const auto blocks = commands_below("");
  ASSERT_EQ(blocks.size(), 2U);
  EXPECT_EQ(blocks[0], std::vector<std::string>{"deploy/demo"});
  EXPECT_EQ(blocks[1], std::vector<std::string>{"deploy/test"});
  const std::string ci = text_of(fs::path(TRAMMEL_SOURCE_DIR) / ".ci/run");
  for (const auto& block : blocks) {
    EXPECT_TRUE(fs::exists(fs::path(TRAMMEL_SOURCE_DIR) / block[0]));
    EXPECT_NE(ci.find("step " + block[0] + "\n"), std::string::npos) << ci;
  }
}

TEST(Readme, TheWorkflowThatItNamesIsThere) {
  const std::string readme = text_of(fs::path(TRAMMEL_SOURCE_DIR) / "README.md"),
                    workflow = "cmake --workflow --preset ";
  const auto at = readme.find(workflow);
  ASSERT_NE(at, std::string::npos);
  const std::string name =
      readme.substr(at + workflow.size(), readme.find('`', at) - at - workflow.size());
  const auto presets =
      nlohmann::json::parse(text_of(fs::path(TRAMMEL_SOURCE_DIR) / "CMakePresets.json"));
  const auto& known = presets.at("workflowPresets");
  EXPECT_TRUE(std::any_of(known.begin(), known.end(), [&](const auto& preset) {
    return preset.at("name") == name;
  })) << name;
}

/// Every file that these pages link to is there.
void expect_links(const std::vector<fs::path>& pages) {
  for (const fs::path& page : pages) {
    const std::string text = text_of(page);
    for (auto at = text.find("]("); at != std::string::npos; at = text.find("](", at + 1)) {
      std::string target = text.substr(at + 2, text.find(')', at) - at - 2);
      target = target.substr(0, target.find('#'));
      if (target.empty() || target.starts_with("http")) continue;
      EXPECT_TRUE(fs::exists(page.parent_path() / target)) << page << ": " << target;
    }
  }
}

void add_pages(const fs::path& folder, std::vector<fs::path>& pages) {
  for (const auto& file : fs::recursive_directory_iterator(folder)) {
    if (file.path().extension() == ".md") pages.push_back(file.path());
  }
}

TEST(Readme, EveryLinkOfEveryPageLeadsToAFile) {
  const fs::path root = TRAMMEL_SOURCE_DIR;
  std::vector<fs::path> pages;
  for (const auto& file : fs::directory_iterator(root)) {
    if (file.path().extension() == ".md") pages.push_back(file.path());
  }
  for (const char* folder : {"server", "idl", "config", "models", "tests", "clients", "deploy"}) {
    if (fs::exists(root / folder)) add_pages(root / folder, pages);
  }
  ASSERT_GE(pages.size(), 10U);
  expect_links(pages);
}

TEST(Readme, EveryLinkOfTheInstalledPagesLeadsToAFile) {
  const test::TemporaryFolder folder;
  const test::Finished installed =
      test::run({"/usr/bin/cmake", "--install", TRAMMEL_BINARY_DIR, "--component", "trammel",
                 "--prefix", folder.path().string()});
  ASSERT_EQ(installed.exit_code, 0) << installed.err;
  const fs::path pages_of = folder.path() / "share/trammel";
  std::vector<fs::path> pages;
  add_pages(pages_of, pages);
  expect_links(pages);
  for (const char* page : {"CELL_FILE.md", "SERVER_FILE.md", "OPERATIONS.md", "README.md"})
    EXPECT_TRUE(fs::exists(pages_of / "config" / page)) << page;
  EXPECT_TRUE(fs::exists(folder.path() / "share/man/man1/trammel-train.1"));
}

TEST(Readme, IsReadInTwoMinutesAndLeadsToThePagesOfAFewMinutesEach) {
  const auto words_of = [](const char* page) {
    std::ifstream file(fs::path(TRAMMEL_SOURCE_DIR) / page);
    int words = 0;
    for (std::string word; file >> word;) words += word.size() > 1 ? 1 : 0;
    return words;
  };
  EXPECT_LE(words_of("README.md"), 450);
  for (const char* page :
       {"config/README.md", "config/CELL_FILE.md", "config/SERVER_FILE.md", "config/OPERATIONS.md"})
    EXPECT_LE(words_of(page), 1500) << page;
}

}  // namespace
}  // namespace trammel
