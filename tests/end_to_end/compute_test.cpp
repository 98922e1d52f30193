// The process that computes for a daemon: what happens to it, and what happens to the daemon
// meanwhile.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <memory>
#include <optional>

#include "clients/session/session.h"
#include "tests/support/computing_child.h"
#include "tests/support/daemon.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kComputeLimit{120};
constexpr int kLargeBatch = 700;  // poses: learning from them takes longer than what is done to it

class ComputeTest : public testing::Test {
 protected:
  void SetUp() override {
    daemon_.start();
    session_ = std::move(client::Session::open(daemon_.session_options()).value());
    const auto first =
        session_->submit_measurements("cell-7", "first", test::virtual_batch_csv(40, 1));
    ASSERT_TRUE(session_->wait_for_job(first.value(), kComputeLimit, nullptr)->in_force);
    context_.cell = "cell-7";
    // A job is told to be over a moment before its process is.
    if (const auto last = test::computing_child(daemon_.process().pid())) {
      ASSERT_TRUE(test::Watched(*last).ends(kComputeLimit));
    }
  }
  /// Until something is computed.
  std::optional<pid_t> computing_now() {
    for (int i = 0; i < 10'000; ++i) {
      if (const auto pid = test::computing_child(daemon_.process().pid())) return pid;
      EXPECT_TRUE(session_->jobs("cell-7"));
    }
    return std::nullopt;
  }
  void answers() {
    const auto answer = session_->predict_error(context_, test::virtual_joints(3, 7));
    EXPECT_TRUE(answer) << answer.error().message;
  }

  test::Daemon daemon_;
  std::unique_ptr<client::Session> session_;
  client::CallContext context_;
};

TEST_F(ComputeTest, ADaemonWhoseComputingIsKilledAnswersAndFinishesTheJob) {
  const auto job =
      session_->submit_measurements("cell-7", "large", test::virtual_batch_csv(kLargeBatch, 2));
  ASSERT_TRUE(job);
  const std::optional<pid_t> computing = computing_now();
  ASSERT_TRUE(computing);
  ::kill(*computing, SIGKILL);
  answers();
  const auto over = session_->wait_for_job(*job, kComputeLimit, nullptr);
  ASSERT_TRUE(over);
  EXPECT_EQ(over->stage, "done") << over->what;
  EXPECT_TRUE(daemon_.process().wait_for_line("signal 9", kComputeLimit))
      << "the log says what happened";
  answers();
  EXPECT_EQ(daemon_.stop(), 0);
}

TEST_F(ComputeTest, ADaemonThatIsKilledTakesItsComputingWithIt) {
  ASSERT_TRUE(
      session_->submit_measurements("cell-7", "large", test::virtual_batch_csv(kLargeBatch, 2)));
  const std::optional<pid_t> computing = computing_now();
  ASSERT_TRUE(computing);
  const test::Watched watched(*computing);
  daemon_.kill();
  EXPECT_TRUE(watched.ends(kComputeLimit)) << "nobody would know of it";
}

TEST_F(ComputeTest, ADaemonWhoseComputingHangsStopsWhenItIsTold) {
  ASSERT_TRUE(
      session_->submit_measurements("cell-7", "large", test::virtual_batch_csv(kLargeBatch, 2)));
  const std::optional<pid_t> computing = computing_now();
  ASSERT_TRUE(computing);
  const test::Watched watched(*computing);
  ::kill(*computing, SIGSTOP);
  answers();
  EXPECT_EQ(daemon_.stop(), 0);
  EXPECT_TRUE(watched.ends(kComputeLimit));
}

}  // namespace
}  // namespace trammel
