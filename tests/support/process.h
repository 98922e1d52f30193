#pragma once

#include <sys/types.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace trammel::test {

/// A program that a test has started, with its output. Ends with the test that owns it, whatever
/// the test does.
class Process {
 public:
  /// argv[0] is the program's path. Aborts when it cannot be started at all.
  explicit Process(const std::vector<std::string>& argv);
  ~Process();  ///< kills it if it still runs
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  /// Its output so far; complete after wait().
  [[nodiscard]] std::string standard_output() const;
  [[nodiscard]] std::string standard_error() const;
  /// Until a whole line of either stream contains `part`; false when the streams end or `limit` is
  /// over first.
  [[nodiscard]] bool wait_for_line(const std::string& part, std::chrono::milliseconds limit);
  void signal(int number) const;
  /// Until it has ended: its exit code, or 128 + the signal that ended it; empty when `limit` is
  /// over first.
  [[nodiscard]] std::optional<int> wait(std::chrono::milliseconds limit);

 private:
  void read(int descriptor, std::string& text);

  pid_t pid_ = -1;
  int pidfd_ = -1;
  std::optional<int> exit_code_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::string out_, err_;  // guarded by mutex_
  int open_streams_ = 2;   // guarded by mutex_
  std::jthread out_reader_, err_reader_;
};

/// A program run to its end.
struct Finished {
  std::optional<int> exit_code;  ///< empty: it was still running after the limit, and is killed
  std::string out, err;
};
[[nodiscard]] Finished run(const std::vector<std::string>& argv,
                           std::chrono::milliseconds limit = std::chrono::seconds(60));

}  // namespace trammel::test
