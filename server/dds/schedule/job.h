#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>

namespace trammel {

using SteadyTime = std::chrono::steady_clock::time_point;
/// Time of one worker.
using Cost = std::chrono::duration<double>;

/// Why a request is not carried out now, and when to try again.
struct Shed {
  std::string why;  ///< one clause
  std::chrono::milliseconds retry_after{0};
  bool too_late = false;  ///< it was accepted, but its time is over now
};

/// A request that is processed in portions. Its items (targets, joint vectors) do not depend on
/// each other. begin(), finish() and shed() are called at most once, by one thread each; exactly
/// one of finish() and shed() is called.
class Job {
 public:
  virtual ~Job() = default;
  /// Looks up everything that the items need. Returns the number of items; 0: there is nothing to
  /// compute.
  [[nodiscard]] virtual std::size_t begin() = 0;
  /// Computes the items [first, first + count). Several threads may call it at once, each with
  /// other items.
  virtual void compute(std::size_t first, std::size_t count) = 0;
  /// Answers: all items are computed.
  virtual void finish() = 0;
  /// Answers that there is not enough time for it.
  virtual void shed(const Shed& shed) = 0;
};

/// The facts that the schedule must know of a request.
struct Ask {
  std::string client;     ///< the sender; clients are served in turn
  std::string cell = {};  ///< empty: of no cell in particular
  std::string work = {};  ///< requests with the same kind share a figure for the cost of an item
  std::size_t items = 1;  ///< as far as the request shows
  std::size_t bytes = 0;  ///< memory while it waits
  SteadyTime start_by{};  ///< nobody waits any longer for the beginning of the work
  std::optional<SteadyTime> finish_by = {};  ///< nor for its end
};

}  // namespace trammel
