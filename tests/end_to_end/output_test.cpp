// A daemon whose output nobody takes any more, or that may write no more, goes on.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <string>
#include <vector>

#include "tests/support/daemon.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kOutputLimit{60};

/// A pipe that is full: who writes to it waits, or is told so.
class FullPipe {
 public:
  FullPipe() {
    if (::pipe2(both_.data(), O_NONBLOCK) != 0) ADD_FAILURE() << "no pipe";
    ::fcntl(both_[0], F_SETFD, FD_CLOEXEC);  // the reader is this process alone
    const std::string some(4096, '.');
    while (::write(both_[1], some.data(), some.size()) > 0) continue;
    ::fcntl(both_[1], F_SETFL, 0);
  }
  ~FullPipe() {
    close_reader();
    ::close(both_[1]);
  }
  FullPipe(const FullPipe&) = delete;
  FullPipe& operator=(const FullPipe&) = delete;

  [[nodiscard]] int writer() const { return both_[1]; }
  void close_reader() {
    if (both_[0] >= 0) ::close(both_[0]);
    both_[0] = -1;
  }

 private:
  std::array<int, 2> both_{-1, -1};
};

/// Runs `words` after `line` of a shell.
std::vector<std::string> after(const std::string& line, const std::vector<std::string>& words) {
  std::vector<std::string> all = {"/bin/sh", "-c", line + " exec \"$@\"", "sh"};
  all.insert(all.end(), words.begin(), words.end());
  return all;
}

std::vector<std::string> with_errors_to(int descriptor, const std::vector<std::string>& words) {
  return after("exec 2>&" + std::to_string(descriptor) + ";", words);
}

bool answers(const test::Daemon& daemon) {
  const auto status = test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "status", "--service",
                                 "--port", std::to_string(daemon.port()), "--domain",
                                 std::to_string(daemon.domain()), "--timeout", "20"});
  return status.exit_code == 0;
}

void expect_serves_and_stops(const test::Daemon& daemon, test::Process& process, FullPipe& errors) {
  EXPECT_TRUE(answers(daemon)) << "the pipe is full";
  errors.close_reader();
  EXPECT_TRUE(answers(daemon)) << "the pipe is closed";
  EXPECT_FALSE(process.wait(std::chrono::milliseconds(0))) << "it runs";
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(kOutputLimit), 0);
}

TEST(OutputTest, ADaemonWhoseErrorsNobodyReadsServesAndStopsAsEver) {
  const test::Daemon daemon;
  FullPipe errors;
  test::Process process(with_errors_to(errors.writer(), daemon.command_line()));
  expect_serves_and_stops(daemon, process, errors);
}

TEST(OutputTest, TheSupervisorOfSuchADaemonGoesOnToo) {
  const test::Daemon daemon;
  FullPipe errors;
  std::vector<std::string> command = {TRAMMEL_SOURCE_DIR "/deploy/supervise"};
  for (const std::string& word : daemon.command_line()) command.push_back(word);
  test::Process process(with_errors_to(errors.writer(), command));
  expect_serves_and_stops(daemon, process, errors);
}

TEST(OutputTest, AFileThatMayGrowNoFurtherRefusesChangesAndEndsNothing) {
  const test::Daemon daemon;
  test::Process process(after("ulimit -f 400;", daemon.command_line()));  // of 512 bytes
  ASSERT_TRUE(process.wait_for_line("ready", kOutputLimit)) << process.standard_error();
  const auto session = client::Session::open(daemon.session_options());
  ASSERT_TRUE(session) << session.error().message;
  std::optional<Error> refused;
  for (int i = 0; i < 40 && !refused; ++i) {
    const auto job = (*session)->submit_measurements("cell-7", "lt-" + std::to_string(i),
                                                     test::virtual_batch_csv(200, 1));
    if (!job) refused = job.error();
  }
  ASSERT_TRUE(refused);
  EXPECT_TRUE(answers(daemon)) << refused->message;
  EXPECT_FALSE(process.wait(std::chrono::milliseconds(0))) << process.standard_error();
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(kOutputLimit), 0);
}

}  // namespace
}  // namespace trammel
