#pragma once

#include <span>
#include <string>
#include <string_view>

namespace trammel {

/// The word of `known` that is closest to `word`: at most two edits (a letter inserted, left out,
/// changed, or swapped with its neighbour) and fewer than half of its letters. Empty if there is
/// none.
[[nodiscard]] std::string near_miss(std::string_view word, std::span<const std::string> known);

/// `, did you mean compliance?`, or nothing.
[[nodiscard]] std::string did_you_mean(std::string_view word, std::span<const std::string> known);

}  // namespace trammel
