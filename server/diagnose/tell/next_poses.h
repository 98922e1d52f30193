#pragma once

#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// Poses of the cell that distinguish the alternatives of a finding. They are chosen greedily: each
/// lowers the uncertainty of the finding's effect most while all its imitators stay free (T-optimal
/// for the fitted effect). Then they are moved while that lowers it further. Empty if nothing is
/// confounded, or if no poses help.
[[nodiscard]] NextPoses next_poses_for(const SearchResult& found, const LinearProblem& before,
                                       const DiagnoseOptions& options);

}  // namespace trammel::cause_search
