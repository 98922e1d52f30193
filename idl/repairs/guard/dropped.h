#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace trammel::wire {

/// Why a packet never reaches the library. README.md of this folder says what the library would do
/// with each.
enum class Dropped : std::uint8_t {
  kHeader,        ///< no RTPS 2 message, or larger than a datagram may be
  kLength,        ///< a submessage that does not fit, or is shorter than its fields
  kStatistics,    ///< a statistics submessage that is not the last one
  kSource,        ///< speaks in the name of another participant, or of none
  kNumber,        ///< a sequence number that no writer reaches, or a range that is none
  kNumberSet,     ///< a set of numbers with more bits than a set has
  kParameters,    ///< inline QoS or an announcement whose lengths and counts do not fit
  kFragment,      ///< fragments that their sample does not have
  kSampleSize,    ///< a sample larger than any topic allows
  kMemory,        ///< too much begun and not finished
  kCount,         ///< a count that has jumped: later honest ones would be ignored
  kSkipped,       ///< too many numbers skipped at once, by all writers together
  kParticipants,  ///< too many participants, or too many from one source
  kNotSent,       ///< asks for fragments of a sample that was never sent in fragments
  kSecurity,      ///< a security submessage without its head or its tail
  kWildcard,      ///< an endpoint in partitions with wildcards
  kEndpoints,     ///< too many endpoints of one participant
  kRepairs,       ///< asks for too much of what was sent before
};
inline constexpr std::size_t kDroppedReasons = 18;

/// For people: "statistics submessage".
[[nodiscard]] const char* name_of(Dropped reason);

/// The number of packets that were dropped for each reason. Thread-safe.
class DropCounts {
 public:
  void add(Dropped reason) {
    counts_[static_cast<std::size_t>(reason)].fetch_add(1, std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t of(Dropped reason) const {
    return counts_[static_cast<std::size_t>(reason)];
  }
  [[nodiscard]] std::uint64_t all() const {
    std::uint64_t sum = 0;
    for (const auto& count : counts_) sum += count;
    return sum;
  }

 private:
  std::array<std::atomic<std::uint64_t>, kDroppedReasons> counts_{};
};

}  // namespace trammel::wire
