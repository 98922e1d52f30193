// Signals come to whichever thread does not block them, also to one that a library has started.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/session/session.h"
#include "tests/support/computing_child.h"
#include "tests/support/daemon.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::seconds;

constexpr seconds kSignalsLimit{30};

/// The daemon with a library that started a thread before main(); the thread takes any signal.
class ALibrarysThread : public testing::Test {
 protected:
  void SetUp() override {
    std::vector<std::string> argv = {"/usr/bin/env", "LD_PRELOAD=" TRAMMEL_THREAD_AT_LOAD};
    const std::vector<std::string> daemon = daemon_.command_line();
    argv.insert(argv.end(), daemon.begin(), daemon.end());
    process_ = std::make_unique<test::Process>(argv);
    ASSERT_TRUE(process_->wait_for_line("ready", kSignalsLimit)) << process_->standard_error();
  }
  /// The thread of the library itself gets the signal.
  void signal_its_thread(int number) const {
    const std::string tasks = "/proc/" + std::to_string(process_->pid()) + "/task";
    for (const auto& task : std::filesystem::directory_iterator(tasks)) {
      if (test::read_file((task.path() / "comm").string()) != "at_load\n") continue;
      ASSERT_EQ(::syscall(SYS_tgkill, process_->pid(), std::stoi(task.path().filename().string()),
                          number),
                0);
      return;
    }
    FAIL() << "the library has no thread";
  }
  void expect_an_orderly_stop() {
    EXPECT_EQ(process_->wait(kSignalsLimit), 0) << process_->standard_error();
    EXPECT_NE(process_->standard_error().find("info stopped"), std::string::npos)
        << process_->standard_error();
  }

  test::Daemon daemon_;
  std::unique_ptr<test::Process> process_;
};

TEST_F(ALibrarysThread, HandsTheReloadOn) {
  signal_its_thread(SIGHUP);
  EXPECT_TRUE(process_->wait_for_line("read again", kSignalsLimit)) << process_->standard_error();
  signal_its_thread(SIGTERM);
  expect_an_orderly_stop();
}

TEST_F(ALibrarysThread, HandsTheStopOn) {
  signal_its_thread(SIGTERM);
  expect_an_orderly_stop();
}

TEST_F(ALibrarysThread, HandsCtrlCOn) {
  signal_its_thread(SIGINT);
  expect_an_orderly_stop();
}

TEST_F(ALibrarysThread, TakesNoSignalThatTheProcessGets) {
  process_->signal(SIGHUP);
  EXPECT_TRUE(process_->wait_for_line("read again", kSignalsLimit)) << process_->standard_error();
  process_->signal(SIGTERM);
  expect_an_orderly_stop();
}

TEST_F(ALibrarysThread, ATrainingIsComputedWithItAndEndsWithTheDaemon) {
  const auto session = std::move(client::Session::open(daemon_.session_options()).value());
  const auto job = session->submit_measurements("cell-7", "first", test::virtual_batch_csv(40, 1));
  ASSERT_TRUE(job);
  process_->signal(SIGHUP);
  EXPECT_TRUE(process_->wait_for_line("read again", kSignalsLimit)) << process_->standard_error();
  const auto over = session->wait_for_job(*job, kSignalsLimit, nullptr);
  ASSERT_TRUE(over) << over.error().message;
  EXPECT_EQ(over->stage, "done") << over->what;
  process_->signal(SIGTERM);
  expect_an_orderly_stop();
}

}  // namespace
}  // namespace trammel
