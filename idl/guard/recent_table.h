#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>

#include "idl/guard/rtps_bytes.h"

namespace trammel::wire {

/// A participant's prefix and an entity id, or two ids mixed.
struct EndpointKey {
  std::array<unsigned char, kPrefix> prefix{};
  std::uint32_t entity = 0;
  friend bool operator==(const EndpointKey&, const EndpointKey&) = default;
};

inline EndpointKey key_of(Bytes prefix, std::uint32_t entity) {
  EndpointKey key;
  std::memcpy(key.prefix.data(), prefix.data(), kPrefix);
  key.entity = entity;
  return key;
}

/// What is known of the endpoints heard last. Of fixed size: the one not heard for longest makes room.
template <typename Value, std::size_t kSets>
class RecentTable {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// Never fails; a value that is new is `Value()`.
  Value& at(const EndpointKey& key, Time now) {
    Set& set = (*sets_)[hash(key) % kSets];
    Entry* oldest = set.data();
    for (Entry& entry : set) {
      if (entry.used && entry.key == key) {
        entry.seen = now;
        return entry.value;
      }
      if (!entry.used || (oldest->used && entry.seen < oldest->seen)) oldest = &entry;
    }
    *oldest = Entry{key, now, true, Value()};
    return oldest->value;
  }

 private:
  static constexpr std::size_t kWays = 8;
  struct Entry {
    EndpointKey key;
    Time seen{};
    bool used = false;
    Value value{};
  };
  using Set = std::array<Entry, kWays>;

  static std::uint64_t hash(const EndpointKey& key) {
    std::uint64_t first = 0;
    std::uint32_t rest = 0;
    std::memcpy(&first, key.prefix.data(), sizeof first);
    std::memcpy(&rest, key.prefix.data() + sizeof first, sizeof rest);
    std::uint64_t mixed = (first ^ (std::uint64_t{rest} << 32 | key.entity)) * 0x9e3779b97f4a7c15u;
    mixed ^= mixed >> 32;
    return mixed * 0xbf58476d1ce4e5b9u >> 20;
  }

  std::unique_ptr<std::array<Set, kSets>> sets_ = std::make_unique<std::array<Set, kSets>>();
};

}  // namespace trammel::wire
