#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <sstream>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

// The tours show what the program prints: each command of a `console` block is run again, and what it prints is held
// against the page. Numbers may differ as processors do; hashes and dates are not compared.
namespace trammel {
namespace {

struct Step {
  std::string command, output;
};

std::vector<Step> steps_of(const std::string& page) {
  std::vector<Step> steps;
  std::istringstream in(page);
  bool inside = false;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("```")) {
      inside = line == "```console";
    } else if (inside && line.starts_with("$ ")) {
      steps.push_back({line.substr(2), ""});
    } else if (inside && !steps.empty()) {
      steps.back().output += line + "\n";
    }
  }
  return steps;
}

bool is_number(const std::string& text, double* value) {
  char* end = nullptr;
  *value = std::strtod(text.c_str(), &end);
  return !text.empty() && *end == '\0';
}

/// Whether both texts have the same words and nearly the same numbers.
testing::AssertionResult alike(const std::string& shown, const std::string& printed) {
  static const std::regex kHash("\\b[0-9a-f]{12}\\b"), kBlanks(" +"), kPart("[-+]?[0-9]+\\.?[0-9]*|[^-+0-9]+|[-+]");
  const auto plain = [](const std::string& text) {
    return std::regex_replace(std::regex_replace(text, kHash, "#"), kBlanks, " ");
  };
  const std::string a = plain(shown), b = plain(printed);
  std::sregex_iterator x(a.begin(), a.end(), kPart), y(b.begin(), b.end(), kPart), end;
  for (; x != end && y != end; ++x, ++y) {
    double was = 0, is = 0;
    if (x->str() == y->str()) continue;
    const bool near =
        is_number(x->str(), &was) && is_number(y->str(), &is) && std::abs(was - is) <= 0.002 + 0.03 * std::abs(was);
    if (!near) return testing::AssertionFailure() << "'" << x->str() << "' is '" << y->str() << "' now:\n" << printed;
  }
  if (x != end || y != end) return testing::AssertionFailure() << "another length now:\n" << printed;
  return testing::AssertionSuccess();
}

class Tour : public testing::TestWithParam<const char*> {};

TEST_P(Tour, ShowsWhatTheProgramPrints) {
  const test::TemporaryFolder folder;
  for (const char* name : {"config", "models"})
    std::filesystem::create_directory_symlink(std::filesystem::path(TRAMMEL_SOURCE_DIR) / name, folder.path() / name);
  const auto steps = steps_of(test::read_file(std::string(TRAMMEL_SOURCE_DIR "/") + GetParam()));
  ASSERT_GE(steps.size(), 8u);
  for (const Step& step : steps) {
    const std::string script = "cd " + folder.path().string() +
                               " && export TRAMMEL_DEFAULTS= PATH=" TRAMMEL_BINARY_DIR "/clients:$PATH && " +
                               step.command;
    const test::Finished finished = test::run({"/bin/bash", "-c", script + " 2>&1"});
    EXPECT_TRUE(alike(step.output, finished.out)) << step.command;
  }
}

INSTANTIATE_TEST_SUITE_P(Pages, Tour, testing::Values("config/TOUR.md", "clients/cam/TOUR.md"), [](const auto& page) {
  return std::string(page.param).find("cam") == std::string::npos ? "OfTheCellEngineer" : "OfTheProgrammer";
});

}  // namespace
}  // namespace trammel
