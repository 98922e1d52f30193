#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "idl/repairs/guard/rtps_bytes.h"

namespace trammel::wire {

/// The number of endpoints that each participant has announced. The library keeps some kilobytes of
/// each until it is said to have gone or its participant's lease is over, and asks each writer that
/// it reads from for its first sample time and again.
class EndpointWatch {
 public:
  static constexpr std::size_t kMostOfServer =
      32768;  ///< it has a writer for each operation of each client
  static constexpr std::size_t kMostOfClient =
      512;  ///< also of a node of ROS 2 with all that is not for us

  explicit EndpointWatch(std::size_t most_of_one) : most_of_one_(most_of_one) {}

  /// False: it is one too many.
  [[nodiscard]] bool found(Bytes prefix, std::uint32_t entity) {
    std::vector<std::uint32_t>& own = endpoints_[key_of(prefix)];
    const auto at = std::lower_bound(own.begin(), own.end(), entity);
    if (at != own.end() && *at == entity) return true;
    if (own.size() >= most_of_one_) return false;
    own.insert(at, entity);
    return true;
  }
  void lost(Bytes prefix, std::uint32_t entity) {
    const auto own = endpoints_.find(key_of(prefix));
    if (own == endpoints_.end()) return;
    const auto at = std::lower_bound(own->second.begin(), own->second.end(), entity);
    if (at != own->second.end() && *at == entity) own->second.erase(at);
  }
  void left(Bytes prefix) { endpoints_.erase(key_of(prefix)); }
  /// All participants that have endpoints here, when they have become many: those that are no
  /// longer there are to be forgotten. Else none.
  [[nodiscard]] std::vector<std::array<unsigned char, kPrefix>> to_be_looked_at() {
    std::vector<Prefix> all;
    if (endpoints_.size() < look_at_) return all;
    look_at_ = 2 * endpoints_.size();
    for (const auto& [prefix, own] : endpoints_) all.push_back(prefix);
    return all;
  }

 private:
  using Prefix = std::array<unsigned char, kPrefix>;
  static Prefix key_of(Bytes prefix) {
    Prefix key{};
    std::copy_n(prefix.begin(), kPrefix, key.begin());
    return key;
  }

  const std::size_t most_of_one_;
  std::size_t look_at_ = 256;
  std::map<Prefix, std::vector<std::uint32_t>> endpoints_;  // entity ids, sorted
};

}  // namespace trammel::wire
