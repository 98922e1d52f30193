#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

namespace trammel {

/// A part of the service that must keep moving.
struct MovingPart {
  const char* name;
  /// A number that changes with every piece of work done; empty while there is no work. Never
  /// waits.
  std::function<std::optional<std::uint64_t>()> mark;
  bool ends_process = true;  ///< false: the watchdog only reports its stillness
};

/// Finds the parts, 64 at most, that have stopped. A look may come late because the process was
/// stopped or the machine was busy. A late look counts as one tick only, so that such pauses do not
/// look like a hang. Not thread-safe.
class Stillness {
 public:
  using Duration = std::chrono::milliseconds;

  /// look() is called every `tick`. A part that has not moved for `limit` has stopped.
  Stillness(std::vector<MovingPart> parts, Duration tick, Duration limit);

  /// Returns the names of the parts that have stopped. `since_last` is the time since the last
  /// look, by a steady clock.
  [[nodiscard]] std::vector<const char*> look(Duration since_last);
  /// The parts that had not moved for `time` at the last look, a bit each, in their order; parts
  /// that do not end the process are included.
  [[nodiscard]] std::uint64_t still_for(Duration time) const;

 private:
  struct Watched {
    MovingPart part;
    std::optional<std::uint64_t> mark;
    Duration still{0};
  };
  std::vector<Watched> watched_;
  Duration tick_, limit_;
};

/// The pieces of work under way. Each piece is short: one that lasts long hangs. Thread-safe,
/// without a lock.
class WorkUnderWay {
 public:
  /// One piece, from its making to its end.
  class Piece {
   public:
    explicit Piece(std::atomic<std::uint64_t>* place) : place_(place) {}
    ~Piece() {
      if (place_ != nullptr) *place_ = 0;
    }
    Piece(const Piece&) = delete;
    Piece& operator=(const Piece&) = delete;

   private:
    std::atomic<std::uint64_t>* place_;
  };

  /// Not watched when there are more than kPlaces at once.
  [[nodiscard]] Piece begin();
  /// The number of the piece that has been under way longest; empty when there is none.
  [[nodiscard]] std::optional<std::uint64_t> oldest() const;

 private:
  static constexpr std::size_t kPlaces = 256;
  std::atomic<std::uint64_t> begun_{0};
  std::array<std::atomic<std::uint64_t>, kPlaces> places_{};  // 0: free
};

}  // namespace trammel
