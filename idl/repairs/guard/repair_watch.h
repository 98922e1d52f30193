#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "idl/repairs/guard/recent_table.h"
#include "idl/repairs/guard/rtps_bytes.h"

namespace trammel::wire {

/// The share of our writers' samples that is asked for again. The library sends it whenever it is
/// asked, in the one thread that sends all of it again: a question of 60 bytes may cost a gigabyte,
/// and the thread is away for seconds. What is asked for is charged with the bytes that it has.
class RepairWatch {
 public:
  using Time = std::chrono::steady_clock::time_point;
  /// Bytes. An honest reader asks for what was lost on the way, or was more than the buffer of its
  /// socket holds.
  static constexpr double kAtOnce = 128e6, kPerSecond = 64e6;  ///< of one participant
  static constexpr double kAllAtOnce = 512e6, kAllPerSecond = 256e6;
  /// The budget may be exceeded by as much as comes back within this time: by the largest sample,
  /// in any case.
  static constexpr double kDebtSeconds = 2;
  static constexpr std::size_t kHistory =
      64;  ///< samples of a writer that are known each; no history is deeper

  /// One of our writers has sent a sample, or a part of it.
  void sent(std::uint32_t writer, std::int64_t number, std::size_t sample_bytes, Time now) {
    Sizes& sizes = sizes_.at(key_of_writer(writer), now);
    if (!sizes.newest) sizes.newest = std::make_unique<std::array<Sample, kHistory>>();
    Sample& place = (*sizes.newest)[static_cast<std::size_t>(number) % kHistory];
    if (number < place.number) return;
    if (place.number != 0 && place.number != number)
      sizes.largest_before = std::max(sizes.largest_before, place.bytes);
    place = {number, static_cast<std::uint32_t>(sample_bytes)};
  }
  /// The bytes that the library may send where somebody asks for this number. For one that left the
  /// histories of requests and replies it sends nothing; announcements of endpoints it keeps, and
  /// they are small.
  [[nodiscard]] double bytes_of(std::uint32_t writer, std::int64_t number, Time now) {
    const Sizes* const sizes = sizes_.find(key_of_writer(writer), now);
    if (sizes == nullptr || number < 1) return 0;
    const Sample& place = (*sizes->newest)[static_cast<std::size_t>(number) % kHistory];
    if (place.number == number) return place.bytes;
    const bool is_kept = number < place.number && (writer & kBuiltIn) == kBuiltIn;
    return is_kept ? sizes->largest_before : 0;
  }
  /// The number of bytes that the participant may be sent again now; 0: none, its reader has to ask
  /// anew. Whoever has asked for little is sent it also where all together have asked for too much.
  [[nodiscard]] double allowed(Bytes prefix, Time now) {
    Bucket& own = buckets_.at(key_of(prefix, 0), now);
    own.refill(kAtOnce, kPerSecond, now);
    all_.refill(kAllAtOnce, kAllPerSecond, now);
    if (own.left <= 0 || (all_.left <= 0 && own.left < kAtOnce / 2)) return 0;
    return own.left + kDebtSeconds * kPerSecond;
  }
  /// It is sent so much of what it is allowed.
  void charge(Bytes prefix, double bytes, Time now) {
    buckets_.at(key_of(prefix, 0), now).left -= bytes;
    all_.left = std::max(all_.left - bytes, -kDebtSeconds * kAllPerSecond);
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
  struct Sample {
    std::int64_t number = 0;  // 0: none
    std::uint32_t bytes = 0;
  };
  struct Sizes {
    std::unique_ptr<std::array<Sample, kHistory>> newest;
    std::uint32_t largest_before = 0;  // of those that are not among them
  };
  static EndpointKey key_of_writer(std::uint32_t writer) {
    EndpointKey key;
    key.entity = writer;
    return key;
  }

  RecentTable<Sizes, 512> sizes_;     // by our writer
  RecentTable<Bucket, 512> buckets_;  // by participant
  Bucket all_;
};

}  // namespace trammel::wire
