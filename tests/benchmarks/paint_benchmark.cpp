// Time until a browser shows the page of a model: Debian's chromium without a window, the page as a
// file, each time in a window of its own. The page is that of a model of 300 poses with a learned
// bias and a batch beside it, which is the heaviest kind.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "server/report/model_page.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"
#include "tests/support/web_browser.h"

namespace trammel {
namespace {

std::string page_of_a_model() {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  TrainOptions options;
  options.bias = "se";
  const CompensatedModel model = test::demand(train(
      cell, test::demand(check_against_cell(test::measured(robot, 300, 1), *cell, drawn(0.2, 1))),
      options));
  return model_page(model,
                    test::demand(check_against_cell(test::measured(robot, 100, 2), *cell)).rows());
}

/// ms from the request to the first thing that is seen.
double painted(const std::string& address) {
  test::WebBrowser browser;
  browser.resize(1400, 900);
  browser.open(address);
  const auto when = browser.run(
      "return new Promise(done => { const look = () => { const all = "
      "performance.getEntriesByType('paint');all.length ? done(all[all.length - 1].startTime) : "
      "setTimeout(look, 20); }; look(); });");
  return when.is_number() ? when.get<double>() : 1e9;
}

void figures(int times) {
  const test::TemporaryFolder folder;
  const std::string page = page_of_a_model();
  const std::string address = "file://" + folder.write("model.html", page);
  std::vector<double> all;
  for (int i = 0; i < times; ++i) all.push_back(painted(address));
  std::sort(all.begin(), all.end());
  fmt::print("figure model page: first paint, median of {}, ms: {:.0f} (aim at most 1000)\n", times,
             all[all.size() / 2]);
  fmt::print("figure model page: first paint, slowest of {}, ms: {:.0f}\n", times, all.back());
  fmt::print("figure model page: weight, kB: {:.0f} (aim at most 1500)\n",
             static_cast<double>(page.size()) / 1000);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("How soon a browser shows the page of a model");
  int times = 9;
  app.add_option("--times", times, "how often it is opened");
  CLI11_PARSE(app, argc, argv);
  trammel::figures(times);
}
