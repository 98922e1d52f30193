#include "server/diagnose/search/held_out.h"

#include "server/diagnose/search/folds.h"

namespace trammel::cause_search {

using Eigen::VectorXd;

VectorXd weight_of(const PriorModel& prior_model, const MeasurementBatch& batch) {
  return LinearProblem(prior_model.model, batch, prior_model.priors, {}).weight();
}

double held_out_square(const PriorModel& prior_model, const MeasurementBatch& batch,
                       const std::vector<Unnamed>& unnamed, const VectorXd& weight) {
  const LinearProblem problem(prior_model.model, batch, prior_model.priors, {});
  const VectorXd left =
      Folds(problem, background_columns(problem, unnamed)).held_out_residual(problem.residual());
  return left.cwiseQuotient(problem.weight()).cwiseProduct(weight).squaredNorm();
}

}  // namespace trammel::cause_search
