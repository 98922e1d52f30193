#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// A file descriptor that closes itself.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() { close(); }
  Descriptor(Descriptor&& other) noexcept : number_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int get() const { return number_; }
  [[nodiscard]] int release();
  void close();

 private:
  int number_ = -1;
};

/// A program that was started to compute. It inherits only a socket to talk by and its standard
/// streams (nothing to read; its output goes to words()). It has no blocked or ignored signals, and
/// a process group of its own, which a terminal's signals do not reach. It ends with this object.
/// It does not come from a plain fork, which would copy the memory of a process with many threads
/// and gigabytes.
class ChildProcess {
 public:
  static constexpr int kChannel = 3;  ///< the descriptor of its end of the socket

  /// argv[0] is the program's path.
  [[nodiscard]] static Result<std::unique_ptr<ChildProcess>> start(
      const std::vector<std::string>& argv);
  ~ChildProcess();  ///< kills it
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  [[nodiscard]] int channel() const { return channel_.get(); }  ///< does not block
  [[nodiscard]] int words() const {
    return words_.get();
  }  ///< does not block; -1: it sends no more
  void close_words() { words_.close(); }
  [[nodiscard]] int end() const { return pidfd_.get(); }  ///< can be read once it has ended
  [[nodiscard]] pid_t pid() const { return pid_; }

  /// Sends SIGKILL and waits until the process is gone; at most a second, in case the kernel does
  /// not release it.
  void kill();
  /// The ending of the process, for people: `signal 11 (Segmentation fault)`, `exit code 1`. Empty
  /// while it runs.
  [[nodiscard]] std::optional<std::string> ending();

  /// The resources that it has used until now, or until it ended.
  struct Usage {
    double processor_time = 0;     ///< s
    std::int64_t peak_memory = 0;  ///< bytes, resident
  };
  [[nodiscard]] Usage usage();
  /// The state of the process: it wants the processor, waits for the disk, or does nothing.
  enum class State { kRuns, kWaitsForDisk, kStands };
  [[nodiscard]] State state() const;

 private:
  ChildProcess() = default;
  /// True if the process is over. Does not wait.
  bool reap();

  pid_t pid_ = -1;
  Descriptor channel_, words_, pidfd_;
  std::optional<int> status_;  // of waitpid, after it has ended
  Usage usage_;
};

/// Bytes of memory that this host, or the container it runs in, has.
[[nodiscard]] std::int64_t memory_of_host();

}  // namespace trammel
