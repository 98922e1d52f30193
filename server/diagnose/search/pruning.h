#pragma once

#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// The place in `result.accepted` of the first cause that fails `limit` (nat) beside all the
/// others. If all pass, it is that of a cause that does not improve the prediction of held-out
/// poses. Empty if every cause gains.
[[nodiscard]] std::optional<std::size_t> weak_cause(const SearchResult& result, double limit);

/// The place in `result.unnamed` of the first anonymous function that is weak likewise.
[[nodiscard]] std::optional<std::size_t> weak_function(const SearchResult& result, double limit);

}  // namespace trammel::cause_search
