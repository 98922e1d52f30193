#pragma once

#include "server/diagnose/search/search_result.h"

namespace trammel {

/// The findings of a search with their numbers: parameters with their intervals by generalised least squares beside
/// everything else that was found, effects, strengths and what each gains on poses held out.
[[nodiscard]] std::vector<Finding> findings_of(const SearchResult& found, const LinearProblem& problem);

/// Beside something unknown that is several times larger a small effect may well be part of it: its name is not sure.
void doubt_beside(const Unexplained& unexplained, std::vector<Finding>& findings);

/// A gear beside a map of its joint, or one of three or more of a joint, may be more of that map: an error with no
/// single order has as many sines as the poses show.
void doubt_single_orders(std::vector<Finding>& findings);

/// Errors of poses held out (blocks of a cross-validation), before and after.
struct HeldOut {
  ErrorFigures before, after;
};
[[nodiscard]] HeldOut held_out_of(const LinearProblem& before, const LinearProblem& after);

}  // namespace trammel
