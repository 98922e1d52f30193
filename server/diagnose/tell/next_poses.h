#pragma once

#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// Poses of the cell that tell apart what a finding could be: greedily, each the one that lowers
/// the uncertainty of its effect most while everything that imitates it stays free (T-optimal for
/// the effect as fitted), then moved while that lowers it further. Empty where nothing is
/// confounded, or where no poses help.
[[nodiscard]] NextPoses next_poses_for(const SearchResult& found, const LinearProblem& before,
                                       const DiagnoseOptions& options);

}  // namespace trammel::cause_search
