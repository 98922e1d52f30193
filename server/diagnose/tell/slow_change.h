#pragma once

#include <string>

#include "server/diagnose/search/search_result.h"
#include "server/diagnose/search/surrogates.h"

namespace trammel::cause_search {

/// The part that moved during the batch, for people, from its size and its course: warming moves
/// slowly and little, slipping moves in steps. Empty if nothing moved. `all`: the background of
/// `problem`, with the functions found.
[[nodiscard]] std::string what_moves(const SearchResult& found, const LinearProblem& problem,
                                     const Background& all, const Surrogates& unrecorded);

/// The poses, ascending, at which a motion along `always` (R, whitened: the full motion at every
/// pose) takes steps. Empty if steps do not explain `data` better than a smooth course whose
/// residual is `smooth_leaves` (a squared whitened size). `rest`: all free columns beside it.
[[nodiscard]] std::vector<Eigen::Index> steps_along(const LinearProblem& problem,
                                                    const Eigen::VectorXd& always,
                                                    const Background& rest,
                                                    const Eigen::VectorXd& data,
                                                    double smooth_leaves);

}  // namespace trammel::cause_search
