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

  /// Bounds in units of scale; -infinity where there is none.
  [[nodiscard]] Eigen::VectorXd lower() const;
};

/// The priors stand around the model's values. Those of a frame that the cell calls unknown are wide: it was found with
/// a chain that was still wrong. Those of sources that are not in `only` are so narrow that nothing changes; empty: all
/// may change.
[[nodiscard]] ScaledParameters scaled_parameters(const PhysicalModel& model, const std::vector<std::string>& only);

}  // namespace trammel
