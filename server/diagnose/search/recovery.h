#pragma once

#include "server/diagnose/search/scan.h"

namespace trammel::cause_search {

/// Hides causes of a few sizes in noise on the user's own poses, and counts how often each is named. `places`: families
/// to hide.
[[nodiscard]] std::vector<Recovery> recovery_of(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                                                const Background& background, const Chance& chance,
                                                const std::vector<std::size_t>& places, std::uint64_t seed);

}  // namespace trammel::cause_search
