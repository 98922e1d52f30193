#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>

#include "idl/repairs/guard/rtps_bytes.h"
#include "server/base/mutex.h"

namespace trammel::wire {

/// The messages that we have sent lately and that may come back to ourselves. Everybody knows our
/// name, so what comes in it is ours only if we have sent it: a number that is skipped in our name
/// would make us deaf to ourselves, and the watchdog would end us. Thread-safe.
class OwnMessages {
 public:
  /// Call it before the message leaves.
  void sent(Bytes message) {
    if (!may_come_back(message)) return;
    const std::uint64_t hash = hash_of(message);
    const MutexLock lock(mutex_);
    (*kept_)[next_++ % kKept] = hash;
  }
  [[nodiscard]] bool has(Bytes message) const {
    const std::uint64_t hash = hash_of(message);
    const MutexLock lock(mutex_);
    return std::find(kept_->begin(), kept_->end(), hash) != kept_->end();
  }

 private:
  static constexpr std::size_t kKept =
      4096;  ///< more than leave in the time that one needs to come back

  /// Not where all of it is for other participants.
  static bool may_come_back(Bytes message) {
    if (message.size() < kHeaderBytes) return false;
    const Bytes self = message.subspan(kPrefixAt, kPrefix);
    bool for_others = false;
    Bytes rest = message.subspan(kHeaderBytes);
    while (const auto submessage = next_submessage(rest)) {
      if (submessage->id == kInfoTimestamp || submessage->id == kStatistics) continue;
      if (submessage->id == kSecureRtpsPrefix || submessage->id == kSecureRtpsPostfix)
        continue;  // around the rest
      if (submessage->id == kInfoSource) continue;
      if (submessage->id != kInfoDestination) {
        if (!for_others) return true;
        continue;
      }
      if (submessage->body.size() < kPrefix) return true;
      const Bytes to = submessage->body.first(kPrefix);
      const bool for_all =
          std::all_of(to.begin(), to.end(), [](unsigned char octet) { return octet == 0; });
      for_others = !for_all && !std::equal(to.begin(), to.end(), self.begin());
    }
    return false;
  }

  /// Without the statistics at the end: the transport below writes them anew for each destination.
  [[nodiscard]] std::uint64_t hash_of(Bytes message) const {
    std::size_t size = message.size();
    Bytes rest = message.subspan(std::min(size, kHeaderBytes));
    while (!rest.empty()) {
      const std::size_t before = message.size() - rest.size();
      const auto submessage = next_submessage(rest);
      if (submessage && submessage->id == kStatistics) size = before;
      if (!submessage || submessage->id == kStatistics) break;
    }
    std::uint64_t hash = seed_ ^ size;
    for (std::size_t i = 0; i < size; i += sizeof hash) {
      std::uint64_t word = 0;
      std::memcpy(&word, message.data() + i, std::min(sizeof word, size - i));
      hash = (hash ^ word) * 0x9e3779b97f4a7c15u;
      hash ^= hash >> 32;
    }
    return hash;
  }

  const std::uint64_t seed_ = std::uint64_t{std::random_device()()} << 32 | std::random_device()();
  mutable Mutex mutex_;
  std::unique_ptr<std::array<std::uint64_t, kKept>> kept_ TRAMMEL_GUARDED_BY(mutex_) =
      std::make_unique<std::array<std::uint64_t, kKept>>();
  std::size_t next_ TRAMMEL_GUARDED_BY(mutex_) = 0;
};

}  // namespace trammel::wire
