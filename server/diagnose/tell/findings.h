#pragma once

#include "server/diagnose/search/search_result.h"
#include "server/diagnose/search/surrogates.h"

namespace trammel::cause_search {

/// The remainder after all findings that have a name.
struct Remainder {
  bool more_than_noise = false;
  double rms = 0;       ///< m
  bool larger = false;  ///< than stated, and not by chance: perhaps more than noise
};

/// The findings of a search, each built once: its numbers beside all other findings (parameters by
/// generalised least squares, effects, strengths, the gain on held-out poses), and the certainty of
/// its name. `problem`: about the extended model. `recorded`: the batch without surrogates.
[[nodiscard]] std::vector<Finding> findings_of(
    const SearchResult& found, const LinearProblem& problem, const Unexplained& unexplained,
    const Surrogates& surrogates, const MeasurementBatch& recorded, const Remainder& remainder);

/// Errors of poses held out, fold by fold, before and after.
struct HeldOut {
  ErrorFigures before, after;
};
[[nodiscard]] HeldOut held_out_of(const LinearProblem& before, const LinearProblem& after);

}  // namespace trammel::cause_search
