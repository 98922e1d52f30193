#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

/// The process in which a service, or a trainer in this process, computes a job.
namespace trammel::test {

/// The program that starts one: the shipped daemon.
[[nodiscard]] std::vector<std::string> compute_program();

/// The child of `parent` that computes; empty while there is none.
[[nodiscard]] std::optional<pid_t> computing_child(pid_t parent);

/// A process that is watched from outside, even one that is not our child. Its pid is not reused
/// meanwhile.
class Watched {
 public:
  explicit Watched(pid_t pid);
  ~Watched();
  Watched(const Watched&) = delete;
  Watched& operator=(const Watched&) = delete;

  /// Until it has ended; false when `limit` is over first.
  [[nodiscard]] bool ends(std::chrono::milliseconds limit) const;
  /// The line `key:` of its status; empty once it has ended.
  [[nodiscard]] std::string status(const std::string& key) const;
  /// Numbers of its open descriptors, in order.
  [[nodiscard]] std::vector<int> descriptors() const;

 private:
  pid_t pid_;
  int pidfd_;
};

}  // namespace trammel::test
