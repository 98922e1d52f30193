#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/error_sources/physical_model.h"

namespace trammel {

/// The P parameters of a model and the priors under which they are identified; solvers see them in units of the priors.
struct ScaledParameters {
  std::vector<Parameter> parameters;
  Eigen::VectorXd scale;    ///< P, SI: standard deviations of the priors
  Eigen::VectorXd typical;  ///< P, SI: the same before priors were widened
  Eigen::VectorXd prior;    ///< P, in units of scale
  std::vector<bool> held;   ///< flags of those that stay as they are; empty: none

  /// Bounds in units of scale; -infinity where there is none.
  [[nodiscard]] Eigen::VectorXd lower() const;
};

/// The priors are centred at the model's values. They are wide for a frame that the cell calls unknown, which was found
/// with a chain that was still wrong, and for a base beside `held` parameters, which was just located. `held`: a flag
/// for each parameter, or empty.
[[nodiscard]] ScaledParameters scaled_parameters(const PhysicalModel& model, const std::vector<bool>& held);

}  // namespace trammel
