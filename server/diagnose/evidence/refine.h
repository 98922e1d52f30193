#pragma once

#include <vector>

#include "server/diagnose/evidence/linear_problem.h"

namespace trammel {

/// A smooth function that no named cause beats.
struct Unnamed {
  std::vector<std::string> depends_on;
  Eigen::MatrixXd columns;  ///< R x m over all poses that are left, SI, of the fitted size
  double score = 0;
  double p_value = 1;
};

/// All columns of a background: the model's own parameters, then what is unnamed. R x p, whitened.
[[nodiscard]] Eigen::MatrixXd background_columns(const LinearProblem& problem, const std::vector<Unnamed>& unnamed);

/// A model with the priors its parameters have, one a parameter.
struct PriorModel {
  PhysicalModel model;
  std::vector<Parameter> priors;
};

/// Adds the source that `spec` names (in its first form), at its prior. Refused as make_error_source().
[[nodiscard]] Status add_to(PriorModel& prior_model, const std::string& spec);
/// Takes the source of that name out.
void remove_from(PriorModel& prior_model, const std::string& source);

/// Identifies all parameters anew, from where they stand, beside what is unnamed: Gauss-Newton on the whitened rows,
/// maximum a posteriori. Returns the sum of squares that is left, priors' included.
double refine(PriorModel& prior_model, const MeasurementBatch& batch, const std::vector<Unnamed>& unnamed);

}  // namespace trammel
