#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>
#include <span>

#include "idl/repairs/guard/rtps_bytes.h"

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

/// The values known of the endpoints heard last. Of fixed size: the one not heard for longest makes
/// room.
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
  /// Null: not known.
  Value* find(const EndpointKey& key, Time now) {
    for (Entry& entry : (*sets_)[hash(key) % kSets]) {
      if (!entry.used || entry.key != key) continue;
      entry.seen = now;
      return &entry.value;
    }
    return nullptr;
  }
  void forget(const EndpointKey& key) {
    for (Entry& entry : (*sets_)[hash(key) % kSets]) {
      if (entry.used && entry.key == key) entry = Entry();
    }
  }
  /// The number of all values.
  template <typename Counts>
  [[nodiscard]] std::size_t count(const Counts& counts) const {
    std::size_t number = 0;
    for (const Set& set : *sets_) {
      for (const Entry& entry : set) number += entry.used && counts(entry.value) ? 1 : 0;
    }
    return number;
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

  /// Nobody outside can know which keys share a set.
  [[nodiscard]] std::uint64_t hash(const EndpointKey& key) const {
    std::uint64_t first = 0;
    std::uint32_t rest = 0;
    std::memcpy(&first, key.prefix.data(), sizeof first);
    std::memcpy(&rest, key.prefix.data() + sizeof first, sizeof rest);
    return mixed(mixed(first ^ seed_) + (std::uint64_t{rest} << 32 | key.entity));
  }
  /// Every bit of the result depends on every bit of `x` (Stafford's thirteenth variant).
  static std::uint64_t mixed(std::uint64_t x) {
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return x ^ x >> 31;
  }

  const std::uint64_t seed_ = std::uint64_t{std::random_device()()} << 32 | std::random_device()();
  std::unique_ptr<std::array<Set, kSets>> sets_ = std::make_unique<std::array<Set, kSets>>();
};

}  // namespace trammel::wire
