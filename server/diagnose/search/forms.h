#pragma once

#include "server/diagnose/search/search_result.h"

/// The forms in which a cause can go into a model: one of those of its record, as compliance has
/// them, or a map of more or fewer harmonics. Poses held out decide between them.
namespace trammel::cause_search {

/// Adds the source of `one` to `result.after`, in place of that of `poorer` where there is one, in
/// the form that predicts poses held out best, and identifies all parameters anew. False, and
/// nothing is changed, where they are predicted no better than without it.
[[nodiscard]] Result<bool> add_in_best_form(SearchResult& result, Accepted& one,
                                            const Accepted* poorer);

/// Chooses the form of each cause in the model that has several, anew beside all that was found
/// since. A form that was chosen while other causes were missing may be the wrong one, and what it
/// leaves over would be given other names. A cause of the cell's own list is changed only where
/// that list (`own_sources`) leaves its form open. False where none is changed.
[[nodiscard]] bool choose_forms_again(SearchResult& result,
                                      const std::vector<std::string>& own_sources);

}  // namespace trammel::cause_search
