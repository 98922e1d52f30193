#pragma once

#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// R: 1 / standard deviation of each row about `prior_model`.
[[nodiscard]] Eigen::VectorXd weight_of(const PriorModel& prior_model,
                                        const MeasurementBatch& batch);

/// Sum of squares of the poses held out, each predicted from the others by `prior_model` and the
/// functions `unnamed`, in units of `weight`, which is equal for all compared models.
[[nodiscard]] double held_out_square(const PriorModel& prior_model, const MeasurementBatch& batch,
                                     const std::vector<Unnamed>& unnamed,
                                     const Eigen::VectorXd& weight);

}  // namespace trammel::cause_search
