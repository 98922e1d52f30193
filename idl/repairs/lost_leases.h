#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "idl/repairs/guard/rtps_bytes.h"
#include "server/base/mutex.h"

namespace trammel::wire {

/// A lease that one side loses, both sides lose. Fast DDS 2.9 drops a participant from which it
/// heard nothing for its lease. If that one has not dropped us at the same time (because it was
/// stopped, say, or because only its own packets were lost), it keeps what it knew. To it we then
/// seem to confirm what we have confirmed before, so it tells us nothing of its endpoints: the two
/// do not see each other until one of them restarts. So after a lost lease neither listens nor
/// talks to the other until that has lost ours; and who finds that it slept itself does so with
/// everybody. Then both find each other as if for the first time. Thread-safe.
class LostLeases {
 public:
  using Prefix = std::array<unsigned char, kPrefix>;  ///< of a participant's GUID
  /// Time since this host was started, also while it was suspended.
  using Time = std::chrono::nanoseconds;
  [[nodiscard]] static Time now();

  /// `lease`: our own, as all others know it. Our announcements are more frequent than that.
  explicit LostLeases(std::chrono::milliseconds lease) : lease_(lease) {}

  /// Call at whatever happens, before anything else: finds that nothing happened for too long.
  void awake(Time now);
  /// True if a message of the participant is to be heard.
  [[nodiscard]] bool lets_in(const Prefix& prefix, Time now);
  /// A participant's announcement that was let in: where it listens (address and port), and its
  /// lease.
  void announced(const Prefix& prefix, std::vector<std::uint64_t> sockets,
                 std::chrono::milliseconds lease, Time now);
  /// It said that it leaves.
  void left(const Prefix& prefix);
  /// The sockets that nothing is to be sent to: those of participants that are not heard, and of no
  /// other one.
  [[nodiscard]] std::vector<std::uint64_t> silent_sockets(Time now);

 private:
  static constexpr std::size_t kMost =
      2048;  // participants; of more, the one not heard for longest is forgotten
  static constexpr std::chrono::milliseconds kMargin{100}, kLonger{500};
  struct PrefixHash {
    std::size_t operator()(const Prefix& prefix) const;
  };
  struct Participant {
    std::vector<std::uint64_t> sockets;
    Time lease{};
    Time heard{};         // last let in
    Time closed_until{};  // since we slept
  };

  [[nodiscard]] Time lost_at(const Participant& who) const {
    return who.heard + who.lease - kMargin;
  }
  [[nodiscard]] Time closed_until(const Participant& who) const;
  [[nodiscard]] bool is_closed(const Participant& who, Time now) const;
  void make_room(Time now) TRAMMEL_REQUIRES(mutex_);

  const Time lease_;
  std::atomic<Time::rep> awake_{0};
  std::atomic<Time::rep> all_open_until_{0};
  Mutex mutex_;
  std::unordered_map<Prefix, Participant, PrefixHash> participants_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel::wire
