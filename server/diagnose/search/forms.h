#pragma once

#include "server/diagnose/search/search_result.h"

/// The forms in which a cause can go into a model: one of the forms of compliance, a map of more or fewer harmonics.
/// Poses held out decide between them.
namespace trammel::cause_search {

/// Adds the source of `one` to `result.after`, in place of that of `poorer` where there is one, in the form that
/// predicts poses held out best, and identifies all parameters anew. False, and nothing is changed, where they are
/// predicted no better than without it.
[[nodiscard]] Result<bool> add_in_best_form(SearchResult& result, Accepted& one, const Accepted* poorer);

/// Chooses the form of the model's compliance anew beside all that was found since. Chosen while much was missing it
/// may be another one, and what a wrong form leaves over would be given other names. A compliance of the cell's own
/// list is changed only where that list leaves its form open: `own_is_open`.
void choose_compliance_again(SearchResult& result, bool own_is_open);

/// Whether a cell's list of error sources leaves the form of the compliance open.
[[nodiscard]] bool leaves_compliance_open(const std::vector<std::string>& sources);

}  // namespace trammel::cause_search
