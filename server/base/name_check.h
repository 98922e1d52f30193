#pragma once

#include <cstddef>
#include <string_view>

#include "server/base/result.h"

namespace trammel {

constexpr std::size_t kMostNameBytes = 256;  ///< of an id or a name, unless its place is smaller
constexpr std::size_t kMostSpellingBytes = 4096;  ///< of a level, a bias
constexpr std::size_t kMostSentenceBytes = 8192;  ///< of a text for people
constexpr std::size_t kMostBatches = 1000;        ///< of the training of one model

/// Refuses a name that is not plain or is longer than `limit_bytes`. `what` names the field in the
/// message: `pose_id`. An empty name is accepted.
[[nodiscard]] Status check_name(std::string_view name, const char* what,
                                std::size_t limit_bytes = kMostNameBytes);

}  // namespace trammel
