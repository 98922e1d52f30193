#pragma once

#include <string>

#include "server/diagnose/search/search_result.h"
#include "server/diagnose/search/surrogates.h"

namespace trammel::cause_search {

/// The part that moved in the course of the batch, for people, by its size and its course: what
/// warms up moves slowly and little, what slips moves in steps. Empty where nothing moved. `all`:
/// the background of `problem`, with the functions found.
[[nodiscard]] std::string what_moves(const SearchResult& found, const LinearProblem& problem,
                                     const Background& all, const Surrogates& unrecorded);

/// The poses at which a motion along `always` (R, whitened: the motion if it had gone all the way
/// at every pose) goes on by steps, ascending; empty where steps do not explain `data` better than
/// a smooth course that leaves `smooth_leaves` of it (a squared whitened size). `rest`: all that is
/// free beside it.
[[nodiscard]] std::vector<Eigen::Index> steps_along(const LinearProblem& problem,
                                                    const Eigen::VectorXd& always,
                                                    const Background& rest,
                                                    const Eigen::VectorXd& data,
                                                    double smooth_leaves);

}  // namespace trammel::cause_search
