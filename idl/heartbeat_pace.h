#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>

#include "idl/guard/rtps_bytes.h"

namespace trammel::wire {

/// Thins what the library tells everybody of its own endpoints. With each announcement that it repeats to one newcomer
/// it sends a HEARTBEAT to all participants, as long as one of them (a client that was killed, say) has not confirmed
/// everything. Everybody answers each. With 30 participants, clients that come and go cost 100,000 packets a second,
/// and the lock that every reply needs. One HEARTBEAT of a writer within kBetween says the same; while anything is
/// unconfirmed the library repeats it by itself. Thread-safe.
class HeartbeatPace {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kBetween{20};

  /// Whether a message of our own is to leave. False only for one that holds nothing but a HEARTBEAT of discovery to
  /// everybody, soon after another of the same writer.
  [[nodiscard]] bool lets_out(Bytes message, Time now = std::chrono::steady_clock::now());

 private:
  static constexpr std::uint32_t kPublications = 0x000003c2, kSubscriptions = 0x000004c2;  // writers of endpoints
  static constexpr std::array<std::uint32_t, 2> kWriters{kPublications, kSubscriptions};

  std::array<std::atomic<Time::rep>, kWriters.size()> last_{};
};

}  // namespace trammel::wire
