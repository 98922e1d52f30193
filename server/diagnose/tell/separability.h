#pragma once

#include <vector>

#include "server/diagnose/search/scan.h"

namespace trammel::cause_search {

/// The causes that a batch could not have shown, and the causes that it cannot distinguish.
struct Blindness {
  std::vector<Unseen> unseen;
  std::vector<Inseparable> inseparable;
};

/// For every named family: the share of its effect outside the model's own parameters, the smallest
/// effect that passes `limit` (nat) in nine of ten batches, and the smallest effect that can be
/// distinguished from its closest imitator. Effects that the model's own parameters, or another
/// cause, absorb are listed as inseparable.
[[nodiscard]] Blindness blindness(const LinearProblem& problem,
                                  const std::vector<FamilyPtr>& families,
                                  const Background& background, const Chance& chance);

}  // namespace trammel::cause_search
