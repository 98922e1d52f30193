#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// Forward selection, one cause at a time, each on the residual of the model found so far. The best
/// candidate is accepted under two conditions. It must pass the score that the best of all
/// candidates reaches by chance in 3 of 1000 batches. It must lower the error of held-out poses,
/// with each fold choosing its cause by itself. An anonymous function that explains more than any
/// named cause joins the background. At the end every cause must still pass beside all others.
///
/// `sources`: the cell's own error sources. Busy if `options.progress` gives up; other errors as
/// calibrate().
[[nodiscard]] Result<SearchResult> search_causes(const std::shared_ptr<const Cell>& cell,
                                                 const std::vector<std::string>& sources,
                                                 const MeasurementBatch& batch,
                                                 const DiagnoseOptions& options);

}  // namespace trammel::cause_search
