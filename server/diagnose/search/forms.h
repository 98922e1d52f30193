#pragma once

#include "server/diagnose/search/search_result.h"

/// The forms that a cause can have in a model: the forms in its record, as for compliance, or a map
/// with more or fewer harmonics. Held-out poses decide between them.
namespace trammel::cause_search {

/// Adds the source of `one` to `result.after` in the form that predicts held-out poses best, and
/// identifies all parameters anew. The source replaces that of `poorer`, if given. Returns false,
/// without any change, if held-out poses are predicted no better with it.
[[nodiscard]] Result<bool> add_in_best_form(SearchResult& result, Accepted& one,
                                            const Accepted* poorer);

/// Chooses again the form of each cause in the model that has several, beside all later findings. A
/// form chosen while other causes were missing may be wrong, and its residual would be given other
/// names. A cause of the cell's own list changes its form only if that list (`own_sources`) leaves
/// it open. Returns false if none changed.
[[nodiscard]] bool choose_forms_again(SearchResult& result,
                                      const std::vector<std::string>& own_sources);

}  // namespace trammel::cause_search
