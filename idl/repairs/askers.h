#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "idl/repairs/guard/rtps_bytes.h"
#include "idl/repairs/lost_leases.h"
#include "server/base/mutex.h"

namespace trammel::wire {

/// True if the message asks for numbers of what discovery tells of our endpoints.
[[nodiscard]] inline bool asks_for_endpoints(Bytes message) {
  constexpr std::uint32_t kPublications = 0x000003c2, kSubscriptions = 0x000004c2;
  if (message.size() < kHeaderBytes) return false;
  Bytes rest = message.subspan(kHeaderBytes);
  while (const auto submessage = next_submessage(rest)) {
    if (submessage->id != kAckNack) continue;
    Reader body(submessage->body, submessage->little_endian());
    static_cast<void>(body.entity());  // the reader
    const auto writer = body.entity();
    static_cast<void>(body.sequence_number());
    if (body.u32().value_or(0) > 0 && (writer == kPublications || writer == kSubscriptions))
      return true;
  }
  return false;
}

/// Who is being told of our endpoints: where it listens, for as long as the library waits before it
/// repeats a HEARTBEAT. A newcomer asks for the next 256 numbers at each HEARTBEAT, so it hears
/// those that HeartbeatPace spares the others. Thread-safe.
class Askers {
 public:
  using Prefix = LostLeases::Prefix;
  using Time = LostLeases::Time;
  static constexpr std::size_t kMost = 512;
  static constexpr std::chrono::milliseconds kAsks{1000};

  void announced(const Prefix& prefix, const std::vector<std::uint64_t>& sockets, Time now) {
    const MutexLock lock(mutex_);
    if (participants_.size() >= kMost)
      std::erase_if(participants_, [now](const auto& entry) { return entry.second.until <= now; });
    if (participants_.size() < kMost || participants_.contains(prefix))
      participants_[prefix].sockets = sockets;
  }
  void asks(const Prefix& prefix, Time now) {
    const MutexLock lock(mutex_);
    const auto who = participants_.find(prefix);
    if (who != participants_.end()) who->second.until = now + kAsks;
  }
  [[nodiscard]] std::vector<std::uint64_t> sockets(Time now) const {
    const MutexLock lock(mutex_);
    std::vector<std::uint64_t> asking;
    for (const auto& [prefix, who] : participants_)
      if (now < who.until) asking.insert(asking.end(), who.sockets.begin(), who.sockets.end());
    return asking;
  }

 private:
  struct Participant {
    std::vector<std::uint64_t> sockets;
    Time until{};
  };
  mutable Mutex mutex_;
  std::map<Prefix, Participant> participants_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel::wire
