#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// Forward selection, one cause at a time, each on what the model found so far leaves over. The
/// best candidate is accepted if it passes the line that the best of all candidates passes by
/// chance in 3 of 1000 batches, and if it lowers the error of poses held out where each fold
/// chooses its cause by itself. An anonymous function that explains more than any named cause
/// becomes part of the background. At the end everything must still pass beside all the rest.
///
/// `sources`: the cell's own error sources. Busy where `options.progress` gives up; else as
/// calibrate() says.
[[nodiscard]] Result<SearchResult> search_causes(const std::shared_ptr<const Cell>& cell,
                                                 const std::vector<std::string>& sources,
                                                 const MeasurementBatch& batch,
                                                 const DiagnoseOptions& options);

}  // namespace trammel::cause_search
