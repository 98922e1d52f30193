// deploy/watching/, held against what is really told.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "server/http/metrics.h"
#include "tests/http/watched_server.h"
#include "tests/support/process.h"

namespace trammel {
namespace {

const std::string kFolder = TRAMMEL_SOURCE_DIR "/deploy/watching/";

std::set<std::string> names_in(const std::string& text) {
  static const std::regex kName("\\b(trammel|process)_[a-z_]+");
  std::set<std::string> names;
  for (auto at = std::sregex_iterator(text.begin(), text.end(), kName); at != std::sregex_iterator(); ++at) {
    std::string name = at->str();
    for (const char* part : {"_bucket", "_sum", "_count"})
      if (name.ends_with(part)) name.resize(name.size() - std::string(part).size());
    names.insert(name);
  }
  return names;
}

/// The names of a server of which everything can be told.
std::set<std::string> names_told() {
  test::WatchedServer server;
  LatencyHistogram latency;
  server.figures.operations = {{"PredictError", latency.counts(), {{"ok", 1}}}};
  server.figures.queues = {{"reads", 0}};
  server.figures.dropped_packets = {{"fragment", 0}};
  server.figures.work = {{"cell-7", {}}};
  server.figures.replica.emplace();
  server.figures.not_recorded = 0;
  // Of a batch whose rows have no times the age of the data is not known.
  const Watched watched = server.watched();
  Metrics metrics(watched);
  JobProgress ended;
  ended.stage = JobStage::kDone;
  metrics.job_changed(ended);
  server.submit("cell-7", "b1", 1);
  server.work();
  std::set<std::string> names;
  const std::string text = metrics.text(ServerPhase::kServing, 0);
  static const std::regex kType("# TYPE ([a-z_]+) ");
  for (auto at = std::sregex_iterator(text.begin(), text.end(), kType); at != std::sregex_iterator(); ++at)
    names.insert((*at)[1]);
  return names;
}

TEST(ShippedWatching, RulesDashboardAndDocumentNameOnlyFiguresThatAreTold) {
  const auto told = names_told();
  const auto expect_told = [&](const std::string& text, const std::string& where) {
    const auto names = names_in(text);
    EXPECT_GE(names.size(), 5u) << where;
    for (const std::string& name : names) {
      const bool at_times = name == "trammel_job_progress_ratio" || name == "trammel_model_data_age_seconds";
      EXPECT_TRUE(told.contains(name) || at_times) << where << ": " << name;
    }
  };
  expect_told(test::read_file(kFolder + "alerts.yml"), "alerts.yml");
  std::string expressions;
  const auto dashboard = nlohmann::json::parse(test::read_file(kFolder + "dashboard.json"));
  for (const auto& panel : dashboard["panels"])
    for (const auto& target : panel["targets"]) expressions += target["expr"].get<std::string>() + "\n";
  expect_told(expressions, "dashboard.json");
  const std::string readme = test::read_file(TRAMMEL_SOURCE_DIR "/server/http/README.md");
  expect_told(readme, "server/http/README.md");
  for (const std::string& name : told)
    EXPECT_TRUE(name.starts_with("process_") || readme.find("`" + name + "`") != std::string::npos)
        << name << " is not in server/http/README.md";
}

TEST(ShippedWatching, ThePanelsOfTheDashboardStandBesideEachOtherAndAskTheChosenPrometheus) {
  const auto dashboard = nlohmann::json::parse(test::read_file(kFolder + "dashboard.json"));
  std::set<int> ids;
  std::set<std::pair<int, int>> places;
  for (const auto& panel : dashboard["panels"]) {
    EXPECT_TRUE(ids.insert(panel["id"].get<int>()).second);
    EXPECT_TRUE(places.insert({panel["gridPos"]["x"].get<int>(), panel["gridPos"]["y"].get<int>()}).second);
    EXPECT_FALSE(panel["title"].get<std::string>().empty());
    EXPECT_FALSE(panel["targets"].empty());
    for (const auto& target : panel["targets"]) EXPECT_EQ(target["datasource"]["uid"], "${datasource}");
  }
  EXPECT_EQ(dashboard["templating"]["list"][0]["name"], "datasource");
}

TEST(ShippedWatching, PromtoolTakesTheRulesAndTheConfiguration) {
  if (test::run({"/bin/sh", "-c", "command -v promtool"}).exit_code != 0)
    GTEST_SKIP() << "promtool is not there (package prometheus)";
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"promtool", "check", "rules", kFolder + "alerts.yml"},
        std::vector<std::string>{"promtool", "check", "config", kFolder + "prometheus.yml"}}) {
    const auto done = test::run({"/usr/bin/env", command[0], command[1], command[2], command[3]});
    EXPECT_EQ(done.exit_code, 0) << done.out << done.err;
  }
}

}  // namespace
}  // namespace trammel
