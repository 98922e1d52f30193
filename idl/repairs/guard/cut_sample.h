#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

/// A sample that is larger than any topic allows, of which only the first octets are kept: the
/// guard cuts it, so that its reader can say why it is refused and goes on to the next one. The
/// options behind the encapsulation identifier (two octets, of which CDR uses the lowest two bits)
/// say so, and how large the sample is.
namespace trammel::wire {

inline constexpr std::size_t kOptionsAt = 2;  ///< octets in front of the options
inline constexpr unsigned char kIsCut = 0x80;
inline constexpr std::size_t kMebibyte = 1u << 20;

/// The options of a cut sample of `bytes`, which are rounded up to mebibytes.
[[nodiscard]] inline std::array<unsigned char, 2> options_of_cut(std::uint32_t bytes) {
  const std::size_t mebibytes = (bytes + kMebibyte - 1) / kMebibyte;
  return {static_cast<unsigned char>(kIsCut | mebibytes >> 8),
          static_cast<unsigned char>(mebibytes)};
}

/// Bytes of the whole sample, of which `sample` is what arrived.
[[nodiscard]] inline std::size_t whole_size(std::span<const unsigned char> sample) {
  if (sample.size() < kOptionsAt + 2 || (sample[kOptionsAt] & kIsCut) == 0) return sample.size();
  const std::size_t mebibytes =
      std::size_t{sample[kOptionsAt]} % kIsCut << 8 | sample[kOptionsAt + 1];
  return std::max(sample.size(), mebibytes * kMebibyte);
}

}  // namespace trammel::wire
