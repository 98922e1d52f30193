#include "tests/support/daemon.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using client::JobStatus;

constexpr std::chrono::seconds kLimit{120};
const client::CallContext kContext = [] {
  client::CallContext context;
  context.cell = "cell-7";
  return context;
}();

class DaemonTest : public testing::Test {
 protected:
  void SetUp() override {
    daemon_.start();
    auto opened = client::Session::open(daemon_.session_options());
    ASSERT_TRUE(opened) << opened.error().message;
    session_ = std::move(*opened);
  }
  std::int64_t submit(const std::string& id, int poses) {
    const auto job = session_->submit_measurements("cell-7", id, test::virtual_batch_csv(poses, 1));
    EXPECT_TRUE(job) << job.error().message;
    return job.value_or(0);
  }
  JobStatus wait_for(std::int64_t job, const std::function<void(const JobStatus&)>& listener = nullptr) {
    const auto over = session_->wait_for_job(job, kLimit, listener);
    EXPECT_TRUE(over) << over.error().message;
    return over.value_or(JobStatus{});
  }
  /// The model that answers for the cell now.
  client::ModelInfo model() {
    const auto answer = session_->predict_error(kContext, test::virtual_joints(3, 7));
    EXPECT_TRUE(answer) << answer.error().message;
    return answer ? answer->model : client::ModelInfo{};
  }

  test::Daemon daemon_;
  std::unique_ptr<client::Session> session_;
};

TEST_F(DaemonTest, ASubmittedBatchBecomesTheModelThatPredicts) {
  std::vector<std::string> stages;
  const JobStatus done = wait_for(submit("lt-07", 120), [&stages](const JobStatus& job) {
    if (stages.empty() || stages.back() != job.stage) stages.push_back(job.stage);
  });
  EXPECT_EQ(done.stage, "done") << done.what;
  EXPECT_TRUE(done.in_force) << done.what;
  EXPECT_EQ(stages.back(), "done");

  const auto answer = session_->predict_error(kContext, test::virtual_joints(20, 7));
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->model.version, done.model_version);
  EXPECT_EQ(answer->model.batch_id, "lt-07");
  ASSERT_EQ(answer->items.size(), 20u);
  double largest = 0;
  for (const auto& item : answer->items) largest = std::max(largest, std::abs(item.dx_mm));
  EXPECT_GT(largest, 0.1) << "the virtual robot misses by millimetres";
}

TEST_F(DaemonTest, ServesTheSameModelAfterARestart) {
  wait_for(submit("lt-07", 60));
  const client::ModelInfo before = model();
  EXPECT_EQ(daemon_.stop(), 0);
  daemon_.start();
  const client::ModelInfo after = model();
  EXPECT_FALSE(before.id.empty());
  EXPECT_EQ(after.id, before.id);
  EXPECT_EQ(after.version, before.version);
  EXPECT_EQ(after.hash, before.hash);
}

TEST_F(DaemonTest, EndsCleanlyWhenAskedToAndSaysSo) {
  EXPECT_EQ(daemon_.stop(), 0) << daemon_.process().standard_error();
  EXPECT_NE(daemon_.process().standard_error().find("stopped"), std::string::npos);
  daemon_.start();
  daemon_.process().signal(SIGINT);
  EXPECT_EQ(daemon_.process().wait(std::chrono::seconds(30)), 0);
}

TEST_F(DaemonTest, EndsCleanlyWhileTrainingAndFinishesTheJobAfterwards) {
  bool stopped = false;
  const std::int64_t job = submit("lt-07", 300);
  const JobStatus done = wait_for(job, [&](const JobStatus& status) {
    if (stopped || status.share < 0.3) return;
    stopped = true;
    EXPECT_EQ(status.stage, "training") << "the training was over before it could be stopped";
    EXPECT_EQ(daemon_.stop(), 0) << daemon_.process().standard_error();
    daemon_.start();
  });
  EXPECT_TRUE(stopped);
  EXPECT_EQ(done.stage, "done") << done.what;
  EXPECT_EQ(model().version, done.model_version);
}

TEST_F(DaemonTest, ASecondOneOnTheSameStoreOrPortIsRefused) {
  auto same_store = daemon_.command_line();
  same_store[4] = std::to_string(daemon_.port() + 2);
  const auto second = test::run(same_store);
  EXPECT_EQ(second.exit_code, 3);
  EXPECT_NE(second.err.find(std::to_string(daemon_.process().pid())), std::string::npos) << second.err;

  auto same_port = daemon_.command_line();
  same_port.insert(same_port.end(), {"--store", daemon_.store_path() + "2"});
  const auto third = test::run(same_port);
  EXPECT_EQ(third.exit_code, 3);
  EXPECT_NE(third.err.find(std::to_string(daemon_.port())), std::string::npos) << third.err;
  EXPECT_EQ(daemon_.stop(), 0);
}

TEST(DaemonCommandLine, ExitsWith2OnWrongUsage) {
  EXPECT_EQ(test::run({test::trammeld_path()}).exit_code, 2);
  EXPECT_EQ(test::run({test::trammeld_path(), "--config", "x", "--bogus"}).exit_code, 2);
  EXPECT_EQ(test::run({test::trammeld_path(), "--config", "x", "--port", "80"}).exit_code, 2);
  EXPECT_EQ(test::run({test::trammeld_path(), "--help"}).exit_code, 0);
}

TEST(DaemonCommandLine, ExitsWith3OnARefusedServerFileAndNamesIt) {
  const test::TemporaryFolder folder;
  const std::string file = folder.write("bad.yaml", "version: 1\nserver: a\nbogus: 1\n");
  const auto refused = test::run({test::trammeld_path(), "--config", file});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_NE(refused.err.find(file), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("bogus"), std::string::npos) << refused.err;
  EXPECT_TRUE(refused.out.empty()) << refused.out;
}

TEST(DaemonCommandLine, ChecksWhatShipsWithoutServing) {
  const auto checked =
      test::run({test::trammeld_path(), "--config", TRAMMEL_SOURCE_DIR "/config/server.yaml", "--check"});
  EXPECT_EQ(checked.exit_code, 0) << checked.err;
  EXPECT_FALSE(std::filesystem::exists(TRAMMEL_SOURCE_DIR "/config/trammel.db"));
}

}  // namespace
}  // namespace trammel
