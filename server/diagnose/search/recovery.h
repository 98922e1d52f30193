#pragma once

#include "server/diagnose/search/scan.h"

namespace trammel::cause_search {

/// Hides causes of several sizes in simulated noise at these very poses, and counts how often each
/// is named. `places`: the families to hide.
[[nodiscard]] std::vector<Recovery> recovery_of(const LinearProblem& problem,
                                                const std::vector<FamilyPtr>& families,
                                                const Background& background, const Chance& chance,
                                                const std::vector<std::size_t>& places,
                                                std::uint64_t seed);

}  // namespace trammel::cause_search
