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
  for (auto at = std::sregex_iterator(text.begin(), text.end(), kName);
       at != std::sregex_iterator(); ++at) {
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
  server.figures.not_recorded = 0;
  // The age of the data is not known for a batch whose rows have no times.
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
  for (auto at = std::sregex_iterator(text.begin(), text.end(), kType);
       at != std::sregex_iterator(); ++at)
    names.insert((*at)[1]);
  return names;
}

TEST(ShippedWatching, RulesDashboardAndDocumentNameOnlyFiguresThatAreTold) {
  const auto told = names_told();
  const auto expect_told = [&](const std::string& text, const std::string& where) {
    const auto names = names_in(text);
    EXPECT_GE(names.size(), 5u) << where;
    for (const std::string& name : names) {
      const bool at_times =
          name == "trammel_job_progress_ratio" || name == "trammel_model_data_age_seconds";
      EXPECT_TRUE(told.contains(name) || at_times) << where << ": " << name;
    }
  };
  expect_told(test::read_file(kFolder + "alerts.yml"), "alerts.yml");
  std::string expressions;
  const auto dashboard = nlohmann::json::parse(test::read_file(kFolder + "dashboard.json"));
  for (const auto& panel : dashboard["panels"])
    for (const auto& target : panel["targets"])
      expressions += target["expr"].get<std::string>() + "\n";
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
    EXPECT_TRUE(
        places.insert({panel["gridPos"]["x"].get<int>(), panel["gridPos"]["y"].get<int>()}).second);
    EXPECT_FALSE(panel["title"].get<std::string>().empty());
    EXPECT_FALSE(panel["targets"].empty());
    for (const auto& target : panel["targets"])
      EXPECT_EQ(target["datasource"]["uid"], "${datasource}");
  }
  EXPECT_EQ(dashboard["templating"]["list"][0]["name"], "datasource");
}

nlohmann::json shipped_dashboard() {
  return nlohmann::json::parse(test::read_file(kFolder + "dashboard.json"));
}

/// As Grafana's schema of dashboards has them (kinds/dashboard of its sources; units:
/// valueFormats/categories.ts).
TEST(ShippedWatching, TheDashboardHasWhatGrafanasSchemaAsksFor) {
  const auto dashboard = shipped_dashboard();
  EXPECT_GE(dashboard["schemaVersion"].get<unsigned>(), 36u);
  EXPECT_TRUE(dashboard["version"].is_number_unsigned());
  EXPECT_GE(dashboard["uid"].get<std::string>().size(), 8u);
  EXPECT_LE(dashboard["uid"].get<std::string>().size(), 40u);
  for (const char* text : {"title", "refresh", "timezone"})
    EXPECT_TRUE(dashboard[text].is_string()) << text;
  for (const char* end : {"from", "to"}) EXPECT_TRUE(dashboard["time"][end].is_string()) << end;
  EXPECT_TRUE(dashboard["annotations"]["list"].is_array());
  static const std::set<std::string> kUnits = {"short", "s",   "bytes",
                                               "reqps", "cps", "percentunit"};
  static const std::set<std::string> kPanels = {"timeseries", "stat", "table", "gauge",
                                                "bargauge",   "text", "row"};
  for (const auto& panel : dashboard["panels"]) {
    SCOPED_TRACE(panel["title"].get<std::string>());
    EXPECT_TRUE(kPanels.contains(panel["type"].get<std::string>()));
    EXPECT_TRUE(panel["options"].is_object());
    EXPECT_TRUE(panel["fieldConfig"]["overrides"].is_array());
    EXPECT_TRUE(kUnits.contains(panel["fieldConfig"]["defaults"]["unit"].get<std::string>()));
    const auto& place = panel["gridPos"];
    EXPECT_GE(place["h"].get<int>(), 1);
    EXPECT_GE(place["w"].get<int>(), 1);
    EXPECT_LE(place["x"].get<int>() + place["w"].get<int>(), 24);
    std::set<std::string> references;
    for (const auto& target : panel["targets"]) {
      EXPECT_TRUE(references.insert(target["refId"].get<std::string>()).second);
      EXPECT_EQ(target["datasource"]["type"], "prometheus");
      EXPECT_TRUE(target["legendFormat"].is_string());
    }
  }
}

TEST(ShippedWatching, TheDashboardAsksWithVariablesThatItHas) {
  const auto dashboard = shipped_dashboard();
  static const std::set<std::string> kTypes = {"query",    "constant", "datasource",
                                               "interval", "textbox",  "custom"};
  std::set<std::string> known;
  for (const auto& variable : dashboard["templating"]["list"]) {
    EXPECT_TRUE(kTypes.contains(variable["type"].get<std::string>()));
    EXPECT_LE(variable["hide"].get<unsigned>(), 2u);
    known.insert(variable["name"].get<std::string>());
  }
  static const std::regex kVariable("\\$\\{?([a-z_]+)");
  const std::string text = dashboard["panels"].dump();
  int used = 0;
  for (auto at = std::sregex_iterator(text.begin(), text.end(), kVariable);
       at != std::sregex_iterator(); ++at, ++used)
    EXPECT_TRUE(known.contains((*at)[1])) << at->str();
  EXPECT_GT(used, 20);
}

TEST(ShippedWatching, PromtoolParsesEveryQueryOfTheDashboard) {
  if (test::run({"/bin/sh", "-c", "command -v promtool"}).exit_code != 0)
    GTEST_SKIP() << "promtool is not there (package prometheus)";
  std::string rules = "groups:\n- name: dashboard\n  rules:\n";
  int count = 0;
  for (const auto& panel : shipped_dashboard()["panels"]) {
    for (const auto& target : panel["targets"]) {
      const std::string query =
          std::regex_replace(target["expr"].get<std::string>(), std::regex("\\$instance"), ".*");
      rules += fmt::format("  - record: \"dashboard:{}\"\n    expr: {}\n", ++count,
                           nlohmann::json(query).dump());
    }
  }
  const test::TemporaryFolder folder;
  const auto done =
      test::run({"/usr/bin/env", "promtool", "check", "rules", folder.write("queries.yml", rules)});
  EXPECT_EQ(done.exit_code, 0) << done.out << done.err;
  EXPECT_NE(done.out.find(fmt::format("{} rules found", count)), std::string::npos) << done.out;
}

TEST(ShippedWatching, PromtoolTakesTheRulesAndTheConfigurationAndTheRulesFireWhenTheyShould) {
  if (test::run({"/bin/sh", "-c", "command -v promtool"}).exit_code != 0)
    GTEST_SKIP() << "promtool is not there (package prometheus)";
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"promtool", "check", "rules", kFolder + "alerts.yml"},
        std::vector<std::string>{"promtool", "check", "config", kFolder + "prometheus.yml"},
        std::vector<std::string>{"promtool", "test", "rules",
                                 TRAMMEL_SOURCE_DIR "/tests/http/alerts_of_the_store.yml"},
        std::vector<std::string>{"promtool", "test", "rules",
                                 TRAMMEL_SOURCE_DIR "/tests/http/alerts_of_the_record.yml"}}) {
    const auto done = test::run({"/usr/bin/env", command[0], command[1], command[2], command[3]});
    EXPECT_EQ(done.exit_code, 0) << done.out << done.err;
  }
}

}  // namespace
}  // namespace trammel
