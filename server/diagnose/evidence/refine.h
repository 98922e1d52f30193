#pragma once

#include <vector>

#include "server/diagnose/evidence/linear_problem.h"

namespace trammel::cause_search {

/// An anonymous function for an effect that no named cause explains.
struct Unnamed {
  std::vector<std::string> depends_on;  ///< `q4`, `time`
  Eigen::MatrixXd columns;  ///< R x m over the poses that are not out, SI, of the fitted size
  double score = 0;         ///< nat
  double p_value = 1;
  std::string wanderer = {};  ///< the slowly moving part, for people, if nothing more is known
};

/// All columns of a background, whitened, R x p: the model's own parameters, then the anonymous
/// functions.
[[nodiscard]] Eigen::MatrixXd background_columns(const LinearProblem& problem,
                                                 const std::vector<Unnamed>& unnamed);

/// A model and the prior of each of its parameters.
struct PriorModel {
  PhysicalModel model;
  std::vector<Parameter> priors;
};

/// Adds the source that `spec` names (in its first form), at its prior. Refused as
/// make_error_source().
[[nodiscard]] Status add_to(PriorModel& prior_model, const std::string& spec);
/// Removes the source of that name.
void remove_from(PriorModel& prior_model, const std::string& source);

/// Identifies all parameters anew from their present values, beside the anonymous functions:
/// Gauss-Newton on the whitened rows, maximum a posteriori. If the weights include the surplus, an
/// effect much larger than its prior may not move: the effect itself counts as noise, and its prior
/// outweighs the data. With the stated weights it moves to the value that the data support.
void refine(PriorModel& prior_model, const MeasurementBatch& batch,
            const std::vector<Unnamed>& unnamed, Weighed weighed = Weighed::kByWhatIsLeft);

}  // namespace trammel::cause_search
