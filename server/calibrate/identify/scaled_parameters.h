#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/error_sources/physical_model.h"

namespace trammel {

/// The F parameters of a model that are to be found, and the priors under which they are; solvers
/// see them in units of the priors. Those that are held have no part in it, however many they are.
struct ScaledParameters {
  std::vector<Parameter> parameters;
  Eigen::VectorXd scale;           ///< F, SI: standard deviations of the priors
  Eigen::VectorXd typical;         ///< F, SI: the same before priors were widened
  Eigen::VectorXd prior;           ///< F, in units of scale
  std::vector<Eigen::Index> free;  ///< F: place of each among the model's P
  Eigen::VectorXd values;          ///< P, SI: of the model, which are those of the priors

  /// Bounds in units of scale; -infinity where there is none.
  [[nodiscard]] Eigen::VectorXd lower() const;
  /// P, SI: the model's values with those that are to be found at `x` (F, in units of scale).
  [[nodiscard]] Eigen::VectorXd values_at(const Eigen::Ref<const Eigen::VectorXd>& x) const;
};

/// The priors are centred at the model's values. They are wide for a frame that the cell calls
/// unknown, which was found with a chain that was still wrong, for what is unknown of the
/// instruments, and for a base beside `held` parameters, which was just located. `held`: a flag for
/// each parameter, or empty.
[[nodiscard]] ScaledParameters scaled_parameters(const PhysicalModel& model,
                                                 const std::vector<bool>& held);

}  // namespace trammel
