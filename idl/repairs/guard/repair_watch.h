#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "idl/repairs/guard/recent_table.h"
#include "idl/repairs/guard/rtps_bytes.h"

namespace trammel::wire {

/// How much of what our writers have sent is asked for again. The library sends it whenever it is asked, in the one
/// thread that sends all of it again: a question of 60 bytes may cost a gigabyte, and the thread is away for seconds.
class RepairWatch {
 public:
  using Time = std::chrono::steady_clock::time_point;
  /// Bytes. An honest reader asks for what was lost on the way, or was more than the buffer of its socket holds.
  static constexpr double kAtOnce = 128e6, kPerSecond = 64e6;  ///< of one participant
  static constexpr double kAllAtOnce = 512e6, kAllPerSecond = 256e6;

  /// One of our writers has sent a sample, or a part of it.
  void sent(std::uint32_t writer, std::size_t sample_bytes, Time now) {
    std::size_t& largest = sizes_.at(key_of_writer(writer), now);
    largest = std::max(largest, sample_bytes);
  }
  /// As much as a sample of this writer may have.
  [[nodiscard]] std::size_t sample_bytes(std::uint32_t writer, Time now) {
    const std::size_t* const largest = sizes_.find(key_of_writer(writer), now);
    return largest == nullptr ? 0 : *largest;
  }
  /// Whether the participant may be sent so many bytes again. If not, its reader asks anew. Whoever has asked for
  /// little is sent it also where all together have asked for too much.
  [[nodiscard]] bool may_ask(Bytes prefix, double bytes, Time now) {
    Bucket& own = buckets_.at(key_of(prefix, 0), now);
    own.refill(kAtOnce, kPerSecond, now);
    all_.refill(kAllAtOnce, kAllPerSecond, now);
    if (own.left <= 0 || (all_.left <= 0 && own.left < kAtOnce / 2)) return false;
    own.left -= bytes;  // below zero: one sample may be larger than all that is allowed at once
    all_.left -= bytes;
    return true;
  }

 private:
  struct Bucket {
    double left = 0;
    Time refilled{};
    void refill(double most, double per_second, Time now) {
      const double passed_s = std::chrono::duration<double>(now - refilled).count();
      left = std::min(most, left + passed_s * per_second);
      refilled = now;
    }
  };
  static EndpointKey key_of_writer(std::uint32_t writer) {
    EndpointKey key;
    key.entity = writer;
    return key;
  }

  RecentTable<std::size_t, 512> sizes_;  // largest sample, by our writer
  RecentTable<Bucket, 512> buckets_;     // by participant
  Bucket all_;
};

}  // namespace trammel::wire
