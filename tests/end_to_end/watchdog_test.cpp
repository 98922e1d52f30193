// Threads of a real daemon are stopped one by one, as a lock inside the library that is never free
// stops them.
#include "server/dds/watchdog.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <memory>

#include "tests/support/daemon.h"
#include "tests/support/stopped_thread.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kWatchdogLimit{30};

/// Threads of this name, once there are `least` of them: a thread names itself as it begins.
std::vector<test::ThreadOf> named(pid_t process, const std::string& name, std::size_t least = 1) {
  const auto deadline = std::chrono::steady_clock::now() + kWatchdogLimit;
  std::vector<test::ThreadOf> threads;
  do {
    threads = test::threads_of(process);
    std::erase_if(threads, [&](const test::ThreadOf& thread) { return thread.name != name; });
  } while (threads.size() < least && std::chrono::steady_clock::now() < deadline);
  return threads;
}

/// True if every thread but the first has a name of its own before long: until then it has that of
/// the process.
bool all_are_named(pid_t process) {
  const auto deadline = std::chrono::steady_clock::now() + kWatchdogLimit;
  while (named(process, "trammeld").size() > 1) {
    if (std::chrono::steady_clock::now() > deadline) return false;
  }
  return true;
}

/// True if a client gets an answer.
bool answers(const test::Daemon& daemon) {
  const auto status = test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "status", "--service",
                                 "--port", std::to_string(daemon.port()), "--domain",
                                 std::to_string(daemon.domain()), "--timeout", "10"});
  return status.exit_code == 0;
}

/// The exit code of the process once its thread is stopped; empty when it goes on.
std::optional<int> end_without(test::Process& process, pid_t thread,
                               std::chrono::milliseconds limit) {
  test::StoppedThread stopped(thread);
  EXPECT_TRUE(stopped.is_stopped()) << "thread " << thread << " cannot be stopped";
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (!process.wait_for_line("ends at once", std::chrono::milliseconds(200)) &&
         std::chrono::steady_clock::now() < deadline) {
    continue;
  }
  if (process.standard_error().find("ends at once") == std::string::npos) return std::nullopt;
  stopped.bury();
  return process.wait(kWatchdogLimit);
}

TEST(WatchdogTest, AStatusThreadThatHangsEndsTheDaemonAndIsNamed) {
  test::Daemon daemon;
  daemon.start();
  const auto status = named(daemon.process().pid(), "status");
  ASSERT_EQ(status.size(), 1u);
  EXPECT_EQ(end_without(daemon.process(), status[0].id, kWatchdogLimit), kExitHung);
  EXPECT_NE(daemon.process().standard_error().find("status"), std::string::npos)
      << daemon.process().standard_error();
  daemon.start();
  EXPECT_TRUE(answers(daemon));
}

TEST(WatchdogTest, AThreadOfRepliesThatHangsEndsTheDaemonAndIsNamed) {
  test::Daemon daemon;
  daemon.start();
  const auto replies = named(daemon.process().pid(), "replies");
  ASSERT_EQ(replies.size(), 1u);
  EXPECT_EQ(end_without(daemon.process(), replies[0].id, kWatchdogLimit), kExitHung);
  EXPECT_NE(daemon.process().standard_error().find("in: replies;"), std::string::npos)
      << daemon.process().standard_error();
}

TEST(WatchdogTest, AnyThreadOfTheLibraryThatHangsEndsTheDaemon) {
  test::Daemon daemon;
  daemon.start();
  const std::size_t count = named(daemon.process().pid(), "dds", 3).size();
  ASSERT_GE(count, 3u) << "events, discovery and data at least";
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0) daemon.start();
    const auto threads = named(daemon.process().pid(), "dds", 3);
    ASSERT_EQ(threads.size(), count);
    EXPECT_EQ(end_without(daemon.process(), threads[i].id, kWatchdogLimit), kExitHung)
        << "thread " << i << " of " << count;
  }
  daemon.start();
  EXPECT_TRUE(answers(daemon));
}

TEST(WatchdogTest, RequestsThatNobodyTakesEndTheDaemonAndTheirKindIsNamed) {
  ::setenv("OPENBLAS_NUM_THREADS", "1", 1);  // a library's own thread has no name of ours
  test::Daemon daemon;
  daemon.start();
  std::vector<std::unique_ptr<test::StoppedThread>> stopped;
  ASSERT_TRUE(all_are_named(daemon.process().pid()));
  for (const test::ThreadOf& thread : named(daemon.process().pid(), "requests", 8)) {
    stopped.push_back(std::make_unique<test::StoppedThread>(thread.id));
    ASSERT_TRUE(stopped.back()->is_stopped());
  }
  EXPECT_FALSE(daemon.process().wait(Watchdog::kLimit + std::chrono::seconds(1)))
      << "nobody asked for anything yet";
  test::Process client({TRAMMEL_BINARY_DIR "/clients/trammel", "models", "--service", "--cell",
                        "cell-7", "--port", std::to_string(daemon.port()), "--domain",
                        std::to_string(daemon.domain()), "--timeout", "20"});
  ASSERT_TRUE(daemon.process().wait_for_line("reading requests; ends at once", kWatchdogLimit))
      << daemon.process().standard_error();
  for (const auto& thread : stopped) thread->bury();
  EXPECT_EQ(daemon.process().wait(kWatchdogLimit), kExitHung);
}

TEST(WatchdogTest, ADaemonThatWasStoppedAndGoesOnIsNotHung) {
  test::Daemon daemon;
  daemon.start();
  EXPECT_TRUE(answers(daemon));
  daemon.process().signal(SIGSTOP);
  EXPECT_FALSE(daemon.process().wait(Watchdog::kLimit + std::chrono::seconds(2)))
      << "it was stopped";
  daemon.process().signal(SIGCONT);
  EXPECT_TRUE(answers(daemon));
  EXPECT_FALSE(daemon.process().wait(std::chrono::seconds(1))) << daemon.process().standard_error();
  EXPECT_EQ(daemon.stop(), 0) << daemon.process().standard_error();
}

TEST(WatchdogTest, ASignalEndsADaemonThatHangsWhileItStops) {
  test::Daemon daemon;
  daemon.start();
  const auto trainer = named(daemon.process().pid(), "trainer");
  ASSERT_EQ(trainer.size(), 1u);
  test::StoppedThread stopped(trainer[0].id);
  ASSERT_TRUE(stopped.is_stopped());
  daemon.process().signal(SIGTERM);
  EXPECT_TRUE(
      daemon.process().wait_for_line("has not stopped after 10 s; ends at once", kWatchdogLimit));
  stopped.bury();
  EXPECT_EQ(daemon.process().wait(kWatchdogLimit), kExitHung);
}

/// The number behind `what` in the newest line that has it.
pid_t number_after(const std::string& text, const std::string& what) {
  const auto at = text.rfind(what);
  return at == std::string::npos ? 0 : std::stoi(text.substr(at + what.size()));
}

const std::string kSupervise = TRAMMEL_SOURCE_DIR "/deploy/supervise";

TEST(SuperviseTest, ADaemonThatHangsIsStartedAgainAndAnswers) {
  const test::Daemon daemon;
  std::vector<std::string> command = {kSupervise, "--first-pause", "0.2"};
  for (const std::string& word : daemon.command_line()) command.push_back(word);
  test::Process supervisor(command);
  ASSERT_TRUE(supervisor.wait_for_line("ready", kWatchdogLimit)) << supervisor.standard_error();
  const pid_t first = number_after(supervisor.standard_error(), "process ");
  const auto status = named(first, "status");
  ASSERT_EQ(status.size(), 1u);
  test::StoppedThread stopped(status[0].id);
  ASSERT_TRUE(stopped.is_stopped());
  ASSERT_TRUE(supervisor.wait_for_line("ends at once", kWatchdogLimit))
      << supervisor.standard_error();
  stopped.bury();
  ASSERT_TRUE(supervisor.wait_for_line("ended with code 70", kWatchdogLimit))
      << supervisor.standard_error();
  EXPECT_TRUE(answers(daemon)) << supervisor.standard_error();
  EXPECT_NE(number_after(supervisor.standard_error(), "process "), first);

  supervisor.signal(SIGTERM);
  EXPECT_EQ(supervisor.wait(kWatchdogLimit), 0) << supervisor.standard_error();
  EXPECT_NE(supervisor.standard_error().find("stopped"), std::string::npos)
      << "the daemon was told to stop";
  EXPECT_FALSE(answers(daemon)) << "and is gone";
}

TEST(SuperviseTest, WhatKeepsEndingIsSaidPlainlyAndStartedWithGrowingPauses) {
  test::Process supervisor(
      {kSupervise, "--first-pause", "0.1", "--longest-pause", "0.4", "/bin/false"});
  ASSERT_TRUE(supervisor.wait_for_line("keeps ending: 5 times", kWatchdogLimit))
      << supervisor.standard_error();
  const std::string said = supervisor.standard_error();
  std::size_t at = 0;
  for (const char* pause : {"in 0.1 s", "in 0.2 s", "in 0.4 s", "in 0.4 s"}) {
    at = said.find(pause, at);
    ASSERT_NE(at, std::string::npos) << pause << " in\n" << said;
    ++at;
  }
  supervisor.signal(SIGTERM);
  EXPECT_TRUE(supervisor.wait(kWatchdogLimit));
}

TEST(SuperviseTest, WhatEndsByItselfOrIsUsedWronglyIsNotStartedAgain) {
  EXPECT_EQ(test::run({kSupervise, "/bin/true"}).exit_code, 0);
  EXPECT_EQ(test::run({kSupervise, test::trammeld_path(), "--bogus"}).exit_code, 2);
  EXPECT_EQ(test::run({kSupervise}).exit_code, 2);
  EXPECT_EQ(test::run({kSupervise, "--help"}).exit_code, 0);
}

}  // namespace
}  // namespace trammel
