#pragma once

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/linear_problem.h"

namespace trammel {

/// Rows that nothing was learned from, against the model before and after.
struct Validation {
  ErrorFigures before, after;
  std::vector<SuspectedPose> fit_neither;                     ///< beyond what either model leaves room for
  std::optional<ErrorFigures> before_without, after_without;  ///< the same without these; empty where there are none
};

/// `before`, `after`: the problems that the models were fitted to. A row fits a model when its squared error over what
/// is expected there (noise, and what the parameters are uncertain by) is below what one in a hundred batches of as
/// many good rows has anywhere.
[[nodiscard]] Validation validate(const LinearProblem& before, const LinearProblem& after,
                                  const MeasurementBatch& rows);

}  // namespace trammel
