#include <gtest/gtest.h>
#include <signal.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/own_ports.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

// The tours show what the programs print: each command of a `console` block is run again, and what
// it prints is held against the page. Numbers may differ as processors do; hashes, dates, versions
// of the program, how long a server is up and what it was asked are not compared. A command goes on
// in lines that begin with `> `, and `export` holds for those below it. Ports and domain of a page
// are those of this test process instead.
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
    } else if (inside && line.starts_with("> ") && !steps.empty() && steps.back().output.empty()) {
      steps.back().command += "\n" + line.substr(2);
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

/// True if both texts have the same words and nearly the same numbers.
testing::AssertionResult alike(const std::string& shown, const std::string& printed) {
  static const std::regex kDate(
      "\\b20[0-9]{2}-[0-9]{2}-[0-9]{2}([T ][0-9]{2}:[0-9]{2}(:[0-9]{2})?Z?)?"),
      kHash("\\b[0-9a-f]{8,64}\\b"), kVersion("\\b[0-9]+\\.[0-9]+\\.[0-9]+\\b(?!\\.)"),
      kSince("up [0-9]+ s, [0-9]+ requests"), kBlanks(" +"),
      kPart("[-+]?[0-9]+\\.?[0-9]*|[^-+0-9]+|[-+]");
  const auto plain = [](std::string text) {
    for (const std::regex* left_out : {&kDate, &kHash, &kVersion, &kSince})
      text = std::regex_replace(text, *left_out, "#");
    return std::regex_replace(text, kBlanks, " ");
  };
  const std::string a = plain(shown), b = plain(printed);
  std::sregex_iterator x(a.begin(), a.end(), kPart), y(b.begin(), b.end(), kPart), end;
  for (; x != end && y != end; ++x, ++y) {
    double was = 0, is = 0;
    if (x->str() == y->str()) continue;
    const bool near = is_number(x->str(), &was) && is_number(y->str(), &is) &&
                      std::abs(was - is) <= 0.002 + 0.03 * std::abs(was);
    if (!near)
      return testing::AssertionFailure() << "'" << x->str() << "' is '" << y->str() << "' now:\n"
                                         << printed;
  }
  if (x != end || y != end)
    return testing::AssertionFailure() << "another length now:\n" << printed;
  return testing::AssertionSuccess();
}

/// With the ports and the domain of this process in place of the page's.
std::string here(std::string text) {
  const int first = test::own_ports();
  const std::vector<std::pair<const char*, int>> ports = {
      {"17500", first}, {"17502", first + 2}, {"9464", first + 4}, {"9465", first + 5}};
  for (const auto& [shown, own] : ports)
    text = std::regex_replace(text, std::regex(std::string("\\b") + shown + "\\b"),
                              std::to_string(own));
  static const std::regex kDomain("(domain[ :=]+)42\\b");
  return std::regex_replace(text, kDomain, "$01" + std::to_string(test::own_domain()));
}

/// Ends what a tour has left running in its folder, where one of its commands has failed.
void end_what_runs_in(const std::filesystem::path& folder) {
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() != ".pid") continue;
    const int pid = std::atoi(test::read_file(file.path().string()).c_str());
    std::error_code gone;
    const auto at = std::filesystem::read_symlink("/proc/" + std::to_string(pid) + "/cwd", gone);
    if (pid > 1 && !gone && at == folder) ::kill(pid, SIGKILL);
  }
  if (const std::string database = (folder / "db").string(); std::filesystem::exists(database))
    static_cast<void>(test::run({TRAMMEL_SOURCE_DIR "/deploy/database", "remove", database}));
}

class Tour : public testing::TestWithParam<const char*> {};

TEST_P(Tour, ShowsWhatTheProgramPrints) {
  const test::TemporaryFolder folder;
  for (const char* name : {"config", "models", "deploy"})
    std::filesystem::create_directory_symlink(std::filesystem::path(TRAMMEL_SOURCE_DIR) / name,
                                              folder.path() / name);
  const auto steps =
      steps_of(here(test::read_file(std::string(TRAMMEL_SOURCE_DIR "/") + GetParam())));
  ASSERT_GE(steps.size(), 8u);
  std::string before = "cd " + folder.path().string() +
                       "\nexport TRAMMEL_DEFAULTS= PATH=" TRAMMEL_BINARY_DIR
                       "/clients:" TRAMMEL_BINARY_DIR "/server:$PATH\nexec 2>&1\n";
  for (const Step& step : steps) {
    if (step.command.starts_with("export ")) before += step.command + "\n";
    const test::Finished finished = test::run({"/bin/bash", "-c", before + step.command});
    EXPECT_TRUE(alike(step.output, finished.out)) << step.command;
  }
  end_what_runs_in(std::filesystem::canonical(folder.path()));
}

std::string reader_of(const testing::TestParamInfo<const char*>& page) {
  const std::string name = page.param;
  if (name.starts_with("config")) return "OfTheCellEngineer";
  if (name.starts_with("clients")) return "OfTheProgrammer";
  return name.starts_with("deploy") ? "OfPlantIt" : "OfTheMetrologist";
}

INSTANTIATE_TEST_SUITE_P(Pages, Tour,
                         testing::Values("config/TOUR.md", "clients/cam/TOUR.md",
                                         "server/diagnose/TOUR.md", "deploy/TOUR.md"),
                         reader_of);

}  // namespace
}  // namespace trammel
