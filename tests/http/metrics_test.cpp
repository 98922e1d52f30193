#include "server/http/metrics.h"

#include <gtest/gtest.h>

#include <sstream>

#include "tests/http/watched_server.h"

namespace trammel {
namespace {

/// By `name{labels}`.
std::map<std::string, double> series_of(const std::string& text) {
  std::map<std::string, double> series;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#")) continue;
    const std::size_t at = line.rfind(' ');
    series[line.substr(0, at)] = std::stod(line.substr(at + 1));
  }
  return series;
}

class MetricsTest : public testing::Test {
 protected:
  std::map<std::string, double> scrape(ServerPhase phase = ServerPhase::kServing) {
    const Watched watched = server_.watched();
    Metrics metrics(watched);
    JobProgress ended;
    ended.stage = JobStage::kDone;
    ended.outcome.verdict = JobVerdict::kInForce;
    metrics.job_changed(ended);
    return series_of(metrics.text(phase, 3));
  }
  test::WatchedServer server_;
};

TEST_F(MetricsTest, SayWhatTheServiceCounted) {
  LatencyHistogram latency;
  latency.add(std::chrono::microseconds(200));
  latency.add(std::chrono::milliseconds(2));
  latency.add(std::chrono::seconds(60));
  server_.figures.operations = {{"PredictError", latency.counts(), {{"ok", 2}, {"busy", 5}}}};
  server_.figures.queues = {{"reads", 4}};
  server_.figures.dropped_packets = {{"fragment", 7}};
  server_.figures.lost = 6;
  auto now = scrape();
  EXPECT_EQ((now["trammel_requests_total{operation=\"PredictError\",result=\"ok\"}"]), 2);
  EXPECT_EQ((now["trammel_requests_total{operation=\"PredictError\",result=\"busy\"}"]), 5);
  EXPECT_EQ((now["trammel_request_seconds_bucket{operation=\"PredictError\",le=\"0.0001\"}"]), 0);
  EXPECT_EQ((now["trammel_request_seconds_bucket{operation=\"PredictError\",le=\"0.00025\"}"]), 1);
  EXPECT_EQ((now["trammel_request_seconds_bucket{operation=\"PredictError\",le=\"0.0025\"}"]), 2)
      << "cumulative";
  EXPECT_EQ((now["trammel_request_seconds_bucket{operation=\"PredictError\",le=\"+Inf\"}"]), 3);
  EXPECT_EQ((now["trammel_request_seconds_count{operation=\"PredictError\"}"]), 3);
  EXPECT_NEAR((now["trammel_request_seconds_sum{operation=\"PredictError\"}"]), 60.0022, 1e-9);
  EXPECT_EQ(now["trammel_requests_waiting{queue=\"reads\"}"], 4);
  EXPECT_EQ(now["trammel_packets_dropped_total{reason=\"fragment\"}"], 7);
  EXPECT_EQ(now["trammel_samples_lost_total"], 6);
  EXPECT_EQ(now["trammel_http_shed_total"], 3);
  EXPECT_EQ(now["trammel_jobs_ended_total{verdict=\"in_force\"}"], 1);
}

TEST_F(MetricsTest, SayWhichCellsAreReadyAndHowOldTheirModelsAre) {
  EXPECT_EQ((scrape()["trammel_cell_ready{cell=\"cell-7\",state=\"untrained\"}"]), 0);
  server_.submit("cell-7", "b1", 1);
  EXPECT_EQ(scrape()["trammel_jobs{state=\"queued\"}"], 1);
  server_.work();
  auto now = scrape();
  EXPECT_EQ((now["trammel_cell_ready{cell=\"cell-7\",state=\"served\"}"]), 1);
  EXPECT_EQ(now["trammel_jobs{state=\"queued\"}"], 0);
  EXPECT_EQ(now["trammel_model_version{cell=\"cell-7\"}"], 1);
  ASSERT_TRUE(now.contains("trammel_model_training_age_seconds{cell=\"cell-7\"}"));
  EXPECT_LT(now["trammel_model_training_age_seconds{cell=\"cell-7\"}"], 600);
  EXPECT_GT(now["trammel_models_in_memory_bytes"], 0);
}

TEST_F(MetricsTest, TheAgeOfAModelThatIsNotInMemoryIsKnownFromTheStore) {
  server_.submit("cell-7", "b1", 1);
  server_.work();
  server_.take_down();
  server_.set_up(0);
  server_.registry().announce("cell-7", 1);
  auto now = scrape();
  EXPECT_EQ((now["trammel_cell_ready{cell=\"cell-7\",state=\"on_disk\"}"]), 1);
  EXPECT_EQ(now["trammel_model_version{cell=\"cell-7\"}"], 1);
}

TEST_F(MetricsTest, SayHowTheDiskAndTheProcessAre) {
  auto now = scrape();
  EXPECT_GT(now["trammel_store_bytes"], 4096);
  EXPECT_GT(now["trammel_store_free_bytes"], 0);
  EXPECT_EQ(now["trammel_store_writable"], 1);
  EXPECT_GT(now["process_resident_memory_bytes"], 1e6);
  EXPECT_GE(now["process_threads"], 1);
  EXPECT_GE(now["process_open_fds"], 3);
}

TEST_F(MetricsTest, AServerThatStartsHasFiguresOfItsProcessOnly) {
  auto now = scrape(ServerPhase::kStarting);
  EXPECT_EQ(now["trammel_serving"], 0);
  EXPECT_GT(now["process_resident_memory_bytes"], 1e6);
  EXPECT_FALSE(now.contains("trammel_store_bytes"));
}

TEST_F(MetricsTest, NamesThatAreHostileStayInTheirLabel) {
  server_.take_down();
  auto named = *test::small_cell("cell-7");
  named.name = "a\"} 1\nfake{x=\"";
  server_.set_cells({{named.name, std::make_shared<const Cell>(named)}});
  server_.set_up();
  const auto now = scrape();
  for (const auto& [series, value] : now) EXPECT_FALSE(series.starts_with("fake")) << series;
}

}  // namespace
}  // namespace trammel
