#pragma once

#include <bit>
#include <cstdint>
#include <optional>

#include "idl/repairs/guard/dropped.h"
#include "idl/repairs/guard/rtps_bytes.h"
#include "idl/repairs/guard/sequence_watch.h"

namespace trammel::wire {

inline constexpr std::uint32_t kMostBits = 256;

[[nodiscard]] inline bool is_number(std::optional<std::int64_t> number) {
  return number && *number >= 1 && *number <= kLargestNumber;
}

/// A set of numbers behind its base.
struct NumberSet {
  std::optional<Dropped> fault;
  std::uint32_t bits = 0;
  std::uint32_t highest = 0;  ///< from the base; 0 also when none is set
  int count = 0;              ///< of those that are set
  Bytes words{};              ///< 32 bits each, the highest bit first
};
[[nodiscard]] inline NumberSet take_set(Reader& reader) {
  const auto bits = reader.u32();
  if (!bits) return {Dropped::kLength};
  if (*bits > kMostBits) return {Dropped::kNumberSet};
  NumberSet set{{}, *bits};
  const auto words = Reader(reader).take((*bits + 31) / 32 * 4);
  if (!words) return {Dropped::kNumberSet};
  set.words = *words;
  for (std::uint32_t i = 0; i < (*bits + 31) / 32; ++i) {
    const std::uint32_t word = reader.u32().value_or(0);
    const std::uint32_t used = *bits - 32 * i;  // of this word; the rest of it counts for nothing
    const std::uint32_t set_bits = used >= 32 ? word : word & ~(UINT32_MAX >> used);
    set.count += std::popcount(set_bits);
    if (set_bits != 0)
      set.highest = 32 * i + 31 - static_cast<std::uint32_t>(std::countr_zero(set_bits));
  }
  return set;
}

/// The entity ids in front of what readers and writers tell each other.
struct Head {
  std::uint32_t reader, writer;
};
[[nodiscard]] inline std::optional<Head> take_head(Reader& reader) {
  const auto to = reader.entity(), from = reader.entity();
  if (!to || !from) return std::nullopt;
  return Head{*to, *from};
}

}  // namespace trammel::wire
