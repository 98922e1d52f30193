#pragma once

#include <optional>
#include <vector>

#include "server/measurement/measurement.h"

/// The resolution of the numbers in a batch. Displays of controllers and short files round them.
namespace trammel {

/// The coarsest step of a decimal file (1, 0.5, 0.1 ...) of which all `values` are whole multiples.
/// Empty if they are finer than 1e-4, hardly differ, or are so few that chance may explain the
/// step.
[[nodiscard]] std::optional<double> step_of(const std::vector<double>& values);

/// Measured numbers with a rounding that is not small against their stated sigma.
struct Rounding {
  double step = 0;   ///< m
  double sigma = 0;  ///< m, stated: the median of the rows
  bool is_of_gauges = false;

  /// m: the standard deviation of the rounding alone.
  [[nodiscard]] double stddev() const;
};
/// The rounding of the positions of `batch`, else of its distances and touches, if its standard
/// deviation is more than half of the stated sigma. Empty if it is less.
[[nodiscard]] std::optional<Rounding> coarse_rounding(const MeasurementBatch& batch,
                                                      const Cell& cell);

/// m: the median of the sigmas that positions have of their own; empty if most have none.
[[nodiscard]] std::optional<double> sigma_of_rows(const MeasurementBatch& batch);

/// rad: the step of the turning joints; empty if they are written finer than 1e-4 deg.
[[nodiscard]] std::optional<double> joint_step(const MeasurementBatch& batch);

}  // namespace trammel
