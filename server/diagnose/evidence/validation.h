#pragma once

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/linear_problem.h"

namespace trammel::cause_search {

/// The error of held-out rows, before and after.
struct Validation {
  ErrorFigures before, after;
  std::vector<SuspectedPose> fit_neither;  ///< rows that fit neither model
  std::optional<ErrorFigures> before_without,
      after_without;  ///< the same without these rows; empty if there are none
};

/// Judges held-out `rows` by the models of `before` and `after`. A row fits a model if its squared
/// error relative to the expected one (noise, and the uncertainty of the parameters) is below a
/// limit. Among equally many good rows, the largest exceeds this limit in 1 of 100 batches.
[[nodiscard]] Validation validate(const LinearProblem& before, const LinearProblem& after,
                                  const MeasurementBatch& rows);

}  // namespace trammel::cause_search
