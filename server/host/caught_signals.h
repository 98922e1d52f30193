#pragma once

#include <chrono>
#include <functional>
#include <thread>

#include "server/base/mutex.h"

namespace trammel {

/// Catches the signals that end the service (SIGTERM, SIGINT) or have it read its files again
/// (SIGHUP).
///
/// Libraries start threads before main() begins, and the kernel gives a signal to any thread that
/// does not block it. So these signals have a handler. In whichever thread it runs, it only writes
/// the signal's number into a pipe. Threads started while such an object exists block the signals,
/// so that none of their calls is interrupted. At most one object exists at a time.
class CaughtSignals {
 public:
  /// `hangs` is called if the process still runs 10 s after a termination signal, of the time that
  /// it lived through (LivedTime). It does not return. `lived` says that time since it was called
  /// last; empty: it is measured.
  explicit CaughtSignals(std::function<void()> hangs,
                         std::function<std::chrono::milliseconds()> lived = {});
  ~CaughtSignals();
  CaughtSignals(const CaughtSignals&) = delete;
  CaughtSignals& operator=(const CaughtSignals&) = delete;

  struct News {
    int ends = 0;  ///< the signal that ends the service; 0: none
    bool reload = false;
  };
  /// Waits for a signal, `limit` at most.
  [[nodiscard]] News wait(std::chrono::milliseconds limit);

 private:
  void take(const std::stop_token& over);
  void note(int number);
  void watch_the_end(const std::stop_token& over) const;

  std::function<void()> hangs_;
  std::function<std::chrono::milliseconds()> lived_;
  int numbers_ = -1;  // the end of the pipe that is read
  Mutex mutex_;
  Condition came_;
  News news_ TRAMMEL_GUARDED_BY(mutex_);
  std::jthread thread_;
};

}  // namespace trammel
