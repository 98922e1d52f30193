#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace trammel::test {

/// A thread of another process.
struct ThreadOf {
  pid_t id = 0;
  std::string name;
};
/// All of `process`, the first it had first.
[[nodiscard]] std::vector<ThreadOf> threads_of(pid_t process);

/// Stops one thread of another process while all its others go on, as a lock that is never free
/// would. Goes on when this is destroyed.
class StoppedThread {
 public:
  explicit StoppedThread(pid_t thread);
  ~StoppedThread();
  StoppedThread(const StoppedThread&) = delete;
  StoppedThread& operator=(const StoppedThread&) = delete;

  [[nodiscard]] bool is_stopped() const { return stopped_; }
  /// Call it after its process has ended; nobody else is notified before.
  void bury();

 private:
  pid_t thread_;
  bool stopped_ = false;
};

}  // namespace trammel::test
