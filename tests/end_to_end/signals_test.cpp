#include <gtest/gtest.h>
#include <signal.h>

#include "tests/support/daemon.h"

namespace trammel {
namespace {

using std::chrono::seconds;

constexpr seconds kLimit{30};

/// The daemon with a library that started a thread before main(); the thread takes any signal.
class ALibrarysThread : public testing::Test {
 protected:
  ALibrarysThread() {
    std::vector<std::string> argv = {"/usr/bin/env", "LD_PRELOAD=" TRAMMEL_THREAD_AT_LOAD};
    const std::vector<std::string> daemon = daemon_.command_line();
    argv.insert(argv.end(), daemon.begin(), daemon.end());
    process_ = std::make_unique<test::Process>(argv);
  }
  void SetUp() override { ASSERT_TRUE(process_->wait_for_line("ready", kLimit)) << process_->standard_error(); }

  test::Daemon daemon_;
  std::unique_ptr<test::Process> process_;
};

TEST_F(ALibrarysThread, DoesNotTakeTheReload) {
  for (int i = 0; i < 5; ++i) {
    const std::size_t before = process_->standard_error().size();
    process_->signal(SIGHUP);
    ASSERT_TRUE(process_->wait_for_line("read again", kLimit)) << process_->standard_error().substr(before);
  }
  process_->signal(SIGTERM);
  EXPECT_EQ(process_->wait(kLimit), 0) << process_->standard_error();
}

TEST_F(ALibrarysThread, DoesNotTakeTheStop) {
  process_->signal(SIGTERM);
  EXPECT_EQ(process_->wait(kLimit), 0) << process_->standard_error();
  EXPECT_NE(process_->standard_error().find("stopped"), std::string::npos);
}

TEST_F(ALibrarysThread, DoesNotTakeCtrlC) {
  process_->signal(SIGINT);
  EXPECT_EQ(process_->wait(kLimit), 0) << process_->standard_error();
}

}  // namespace
}  // namespace trammel
