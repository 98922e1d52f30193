#pragma once

#include <span>
#include <string>
#include <string_view>

namespace trammel {

/// The word of `known` that somebody who wrote `word` may have meant: at most two letters put in, left out, changed or
/// swapped with their neighbour, and fewer than half of them. Empty where there is none.
[[nodiscard]] std::string near_miss(std::string_view word, std::span<const std::string> known);

/// `, did you mean compliance?`, or nothing.
[[nodiscard]] std::string did_you_mean(std::string_view word, std::span<const std::string> known);

}  // namespace trammel
