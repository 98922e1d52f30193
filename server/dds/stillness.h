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
  /// Another number whenever the part has done something more; empty while it has nothing to do. Never waits.
  std::function<std::optional<std::uint64_t>()> mark;
};

/// Tells which parts have stopped. Time is what the watcher itself lived through: a look that comes late, because the
/// process was stopped or the machine was busy, counts as one that came in time. Not thread-safe.
class Stillness {
 public:
  using Duration = std::chrono::milliseconds;

  /// Looks come every `tick`; a part that has not moved for `limit` has stopped.
  Stillness(std::vector<MovingPart> parts, Duration tick, Duration limit);

  /// `since_last`: since the look before, by a clock that never jumps. Names of the parts that have stopped.
  [[nodiscard]] std::vector<const char*> look(Duration since_last);

 private:
  struct Watched {
    MovingPart part;
    std::optional<std::uint64_t> mark;
    Duration still{0};
  };
  std::vector<Watched> watched_;
  Duration tick_, limit_;
};

/// Which pieces of work are under way, each of which ends soon or never. Thread-safe, without a lock.
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
  /// The number of the one that has been under way longest; empty when there is none.
  [[nodiscard]] std::optional<std::uint64_t> oldest() const;

 private:
  static constexpr std::size_t kPlaces = 256;
  std::atomic<std::uint64_t> begun_{0};
  std::array<std::atomic<std::uint64_t>, kPlaces> places_{};  // 0: free
};

}  // namespace trammel
