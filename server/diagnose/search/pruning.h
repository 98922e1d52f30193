#pragma once

#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// The place in `result.accepted` of the first cause that does not pass `limit` (nat) any more
/// beside all the rest, or, where all pass, of one with which poses held out are predicted no
/// better: a name that gains nothing is none. Empty where all do.
[[nodiscard]] std::optional<std::size_t> weak_cause(const SearchResult& result, double limit);

/// The place in `result.unnamed` of the first anonymous function that is weak likewise.
[[nodiscard]] std::optional<std::size_t> weak_function(const SearchResult& result, double limit);

}  // namespace trammel::cause_search
