#pragma once

#include <optional>

#include "server/diagnose/search/standing.h"

namespace trammel::cause_search {

/// What moves slowly where a cause is said to move at once (a step) or steadily (a drift): the same motion as the cause
/// was fitted with, times a smooth function of time.
struct SlowRival {
  FamilyPtr family;
  Best best;
  double gap = 0;  ///< nat: evidence beyond the cause's own, both of one motion
};
/// Of the family at `place`, as `seen`. Empty where it moves neither at once nor steadily.
[[nodiscard]] std::optional<SlowRival> slow_rival(const Standing& standing, const Scan& seen, std::size_t place);

}  // namespace trammel::cause_search
