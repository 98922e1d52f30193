#pragma once

#include <optional>
#include <vector>

#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// The cause that takes the place of everything that has no name.
struct NamedInstead {
  Cause cause;
  PriorModel model;           ///< with it, identified without the functions
  std::vector<Cause> rivals;  ///< that predict the poses held out as well
};

/// A function has no name only where the whole list of causes does not explain it. Each cause of
/// the whole arm or cell that the model lacks is tried in the place of all functions, and not to
/// first order: a rail that runs off its drawn direction moves the arm by more than a derivative
/// holds. Empty where none predicts poses held out as well as the functions do, but for
/// `thresholds::kAsGoodHeldOut`. Where no function was found and far more than noise is left
/// (`thresholds::kLeavesMuch`), causes of single joints are tried as well, and one must leave half
/// the squares. `closed`: were tried before.
[[nodiscard]] std::optional<NamedInstead> named_instead_of_functions(
    const SearchResult& result, const std::vector<Cause>& closed);

}  // namespace trammel::cause_search
