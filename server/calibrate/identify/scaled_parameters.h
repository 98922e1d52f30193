#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/error_sources/physical_model.h"

namespace trammel {

/// The P parameters of a model with the priors that they are identified under; solvers see them in units of these.
struct ScaledParameters {
  std::vector<Parameter> parameters;
  Eigen::VectorXd scale;    ///< P, SI: standard deviations of the priors
  Eigen::VectorXd typical;  ///< P, SI: the same where nothing was widened
  Eigen::VectorXd prior;    ///< P, in units of scale
  std::vector<bool> held;   ///< those that stay as they are; empty: none

  /// Bounds in units of scale; -infinity where there is none.
  [[nodiscard]] Eigen::VectorXd lower() const;
};

/// The priors stand around the model's values. Those of a frame that the cell calls unknown are wide: it was found with
/// a chain that was still wrong; so are those of a base beside `held` parameters, which was just localised. `held`: one
/// flag a parameter, or none.
[[nodiscard]] ScaledParameters scaled_parameters(const PhysicalModel& model, const std::vector<bool>& held);

}  // namespace trammel
