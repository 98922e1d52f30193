#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/base/mutex.h"
#include "server/dds/schedule/job.h"
#include "server/dds/schedule/room.h"
#include "server/dds/schedule/turns.h"
#include "server/dds/stillness.h"

namespace trammel {

/// Requests of one kind and the workers that carry them out in turns: see Turns. A worker goes on
/// to the next client after one portion; the portions of one request go to all workers that have
/// nothing better to do. Thread-safe.
class Lane {
 public:
  using Clock = std::function<SteadyTime()>;

  /// `room` outlives it. `nice` is added to the priority value of the workers.
  Lane(
      const TurnLimits& limits, Room& room, int nice = 0,
      Clock now = [] { return std::chrono::steady_clock::now(); });
  ~Lane();  ///< stops as stop()

  /// Starts the workers.
  void start();
  /// Lets the portions under way end, and sheds all other requests. Nothing is taken in afterwards.
  void stop();
  /// Accepts the request, or returns the reason of a rejection. Neither waits nor works; the caller
  /// sheds a rejected request.
  [[nodiscard]] std::optional<Shed> submit(std::shared_ptr<Job> job, Ask ask);
  /// See Turns::set_limits().
  void set_limits(const TurnLimits& limits);
  /// Works on one portion in the calling thread. False: there was nothing to do.
  [[nodiscard]] bool step(Turns::Which which = Turns::Which::kAll);
  /// Sheds waiting requests whose time is over, even if all workers are busy.
  void shed_late();

  [[nodiscard]] std::size_t requests() const;
  /// The number of the oldest portion under way; empty if there is none. Takes no lock.
  [[nodiscard]] std::optional<std::uint64_t> oldest_portion() const { return under_way_.oldest(); }
  /// For the watchdog: a number if a request could be processed but no idle worker has taken it;
  /// else empty. It is the number of portions taken so far. Takes no lock.
  [[nodiscard]] std::optional<std::uint64_t> unseen() const;

 private:
  void work(const std::stop_token& stop, Turns::Which which);
  void watch_times(const std::stop_token& stop);
  [[nodiscard]] std::optional<Turns::Portion> next(Turns::Which which) TRAMMEL_REQUIRES(mutex_);
  void run(const Turns::Portion& portion);
  [[nodiscard]] Turns::Done work_on(const Turns::Portion& portion);
  /// True if there is something to compute.
  [[nodiscard]] bool begin(Turns::Entry& entry);
  /// Items of the request until the portion that began at `begun` is over.
  void compute(Turns::Entry& entry, SteadyTime begun, Turns::Done* done);

  const TurnLimits limits_;
  Room& room_;
  const int nice_;
  const Clock now_;
  mutable Mutex mutex_;
  Turns turns_ TRAMMEL_GUARDED_BY(mutex_);
  bool stopped_ TRAMMEL_GUARDED_BY(mutex_) = false;
  Condition arrived_, express_arrived_;
  Condition next_look_;                                    // nobody notifies it
  bool waits_ TRAMMEL_GUARDED_BY(mutex_) = false;          // something is workable
  bool express_waits_ TRAMMEL_GUARDED_BY(mutex_) = false;  // by express workers
  std::atomic<bool> workable_{false};                      // as waits_, for the watchdog
  std::atomic<int> idle_{0};                // workers asleep, the express ones left out
  std::atomic<std::uint64_t> taken_up_{0};  // portions
  WorkUnderWay under_way_;                  // portions
  std::vector<std::jthread> workers_;
};

}  // namespace trammel
