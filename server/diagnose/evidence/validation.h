#pragma once

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/linear_problem.h"

namespace trammel::cause_search {

/// The error of held-out rows, before and after.
struct Validation {
  ErrorFigures before, after;
  std::vector<SuspectedPose> fit_neither;  ///< rows that fit neither model
  std::optional<ErrorFigures> before_without,
      after_without;  ///< the same without these; empty where there are none
};

/// Judges held-out `rows` by the models that `before` and `after` were made about. A row fits a
/// model when its squared error over the expected one (noise, and the uncertainty of the
/// parameters) stays below what the largest of as many good rows exceeds in 1 of 100 batches.
[[nodiscard]] Validation validate(const LinearProblem& before, const LinearProblem& after,
                                  const MeasurementBatch& rows);

}  // namespace trammel::cause_search
