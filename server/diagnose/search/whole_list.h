#pragma once

#include <optional>
#include <vector>

#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// The cause that replaces all nameless functions.
struct NamedInstead {
  Cause cause;
  PriorModel model;           ///< with the cause, identified without the functions
  std::vector<Cause> rivals;  ///< causes that predict the held-out poses equally well
};

/// Tries to replace all nameless functions by one cause of the whole list. Each cause of the whole
/// arm or cell that the model lacks is tried exactly, not to first order: a rail that runs off its
/// drawn direction moves the arm beyond the reach of a derivative. Empty if none predicts held-out
/// poses as well as the functions, within `thresholds::kAsGoodHeldOut`. If no function was found
/// and far more than noise is left (`thresholds::kLeavesMuch`), causes of single joints are tried
/// as well, and one must halve the squares. `closed`: causes that were tried before.
[[nodiscard]] std::optional<NamedInstead> named_instead_of_functions(
    const SearchResult& result, const std::vector<Cause>& closed);

}  // namespace trammel::cause_search
