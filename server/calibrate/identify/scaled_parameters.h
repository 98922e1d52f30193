#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/error_sources/physical_model.h"

namespace trammel {

/// The F free parameters of a model and their priors. Solvers see the parameters in units of the
/// priors. Held parameters are left out, so their number costs nothing.
struct ScaledParameters {
  std::vector<Parameter> parameters;
  Eigen::VectorXd scale;           ///< F, SI: standard deviations of the priors
  Eigen::VectorXd typical;         ///< F, SI: the same before priors were widened
  Eigen::VectorXd prior;           ///< F, in units of scale
  std::vector<Eigen::Index> free;  ///< F: place of each among the model's P
  Eigen::VectorXd values;          ///< P, SI: the model's values, at which the priors are centred

  /// Bounds in units of scale; -infinity where there is none.
  [[nodiscard]] Eigen::VectorXd lower() const;
  /// P, SI: the model's values with the free ones set to `x` (F, in units of scale).
  [[nodiscard]] Eigen::VectorXd values_at(const Eigen::Ref<const Eigen::VectorXd>& x) const;
};

/// The priors are centred at the model's values. They are wide for three kinds of parameters: a
/// frame that the cell calls unknown, since it was located with an uncorrected chain; unknowns of
/// the instruments; and a base beside `held` parameters, since it was just located. `held` has a
/// flag for each parameter, or is empty.
[[nodiscard]] ScaledParameters scaled_parameters(const PhysicalModel& model,
                                                 const std::vector<bool>& held);

}  // namespace trammel
