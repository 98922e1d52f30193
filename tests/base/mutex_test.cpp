#include "server/base/mutex.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <thread>

#include "server/base/text_file.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

class Counter {
 public:
  void add() {
    {
      const MutexLock lock(mutex_);
      ++count_;
    }
    changed_.notify_all();
  }
  /// False when asked to stop before.
  bool wait_for(int count, const std::stop_token& stop) {
    MutexLock lock(mutex_);
    return changed_.wait(lock, stop, [&]() TRAMMEL_REQUIRES(mutex_) { return count_ >= count; });
  }
  void wait_for(int count) {
    MutexLock lock(mutex_);
    changed_.wait(lock, [&]() TRAMMEL_REQUIRES(mutex_) { return count_ >= count; });
  }
  bool reaches(int count, std::chrono::milliseconds limit) {
    MutexLock lock(mutex_);
    return changed_.wait_until(lock, std::chrono::steady_clock::now() + limit,
                               [&]() TRAMMEL_REQUIRES(mutex_) { return count_ >= count; });
  }

 private:
  Mutex mutex_;
  Condition changed_;
  int count_ TRAMMEL_GUARDED_BY(mutex_) = 0;
};

TEST(Mutex, WaitingSeesWhatAnotherThreadDidUnderTheSameLock) {
  Counter counter;
  constexpr int kEach = 1000;
  const auto count = [&counter] {
    for (int i = 0; i < kEach; ++i) counter.add();
  };
  const std::jthread one(count), two(count);
  counter.wait_for(2 * kEach);
  EXPECT_FALSE(counter.reaches(2 * kEach + 1, std::chrono::milliseconds(1)));
}

TEST(Mutex, WaitingEndsWhenAskedToStop) {
  Counter counter;
  std::stop_source stop;
  std::jthread waits([&] { EXPECT_FALSE(counter.wait_for(1, stop.get_token())); });
  stop.request_stop();
  waits.join();
  counter.add();
  EXPECT_TRUE(counter.wait_for(1, stop.get_token()))
      << "what is ready is said to be, stopped or not";
}

/// The answer of clang, as `deploy/check threads` calls it, to a class with a guarded member and
/// this body of a function.
test::Finished clang_on(const std::string& body) {
  const test::TemporaryFolder folder;
  const std::string source = folder.file("snippet.cpp");
  EXPECT_TRUE(write_text_file(source,
                              "#include \"server/base/mutex.h\"\n"
                              "class Jobs {\n"
                              " public:\n"
                              "  int next() { " +
                                  body +
                                  " }\n"
                                  " private:\n"
                                  "  int last() const TRAMMEL_REQUIRES(mutex_) { return last_; }\n"
                                  "  trammel::Mutex mutex_;\n"
                                  "  trammel::Condition changed_;\n"
                                  "  int last_ TRAMMEL_GUARDED_BY(mutex_) = 0;\n"
                                  "};\n"));
  return test::run({"/usr/bin/clang++-14", "-std=c++20", "-fsyntax-only", "-Wthread-safety",
                    "-Werror=thread-safety", std::string("-I") + TRAMMEL_SOURCE_DIR, source});
}

TEST(Mutex, CodeThatTouchesAGuardedMemberWithoutItsLockIsRefused) {
  if (!std::filesystem::exists("/usr/bin/clang++-14")) GTEST_SKIP() << "clang-14 is not installed";
  const auto accepted = [](const std::string& body) {
    const test::Finished finished = clang_on(body);
    const bool understood =
        finished.exit_code == 0 || finished.err.find("thread-safety") != std::string::npos;
    EXPECT_TRUE(understood) << finished.err;
    return finished.exit_code == 0;
  };
  EXPECT_TRUE(accepted("const trammel::MutexLock lock(mutex_); return ++last_;"));
  EXPECT_TRUE(
      accepted("trammel::MutexLock lock(mutex_); lock.unlock(); lock.lock(); return last();"));
  EXPECT_TRUE(
      accepted("trammel::MutexLock lock(mutex_);changed_.wait(lock, [this]() "
               "TRAMMEL_REQUIRES(mutex_) { return last_ > 0; }); return last_;"));
  EXPECT_FALSE(accepted("return last_;"));
  EXPECT_FALSE(accepted("last_ = 1; return 1;"));
  EXPECT_FALSE(accepted("return last();"));
  EXPECT_FALSE(accepted("{ const trammel::MutexLock lock(mutex_); ++last_; } return last_;"));
  EXPECT_FALSE(accepted("trammel::MutexLock lock(mutex_); lock.unlock(); return last_;"));
  EXPECT_FALSE(
      accepted("trammel::MutexLock lock(mutex_); changed_.wait(lock, [this] { return last_ > 0; "
               "}); return 1;"));
}

}  // namespace
}  // namespace trammel
