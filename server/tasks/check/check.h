#pragma once

#include <optional>
#include <vector>

#include "server/health/health_check.h"

namespace trammel {

/// The questions to a check beside its poses.
struct CheckAsked {
  std::optional<double> tolerance = {};  ///< m; empty: the cell's
  bool new_tool = false;                 ///< HealthOptions::new_tool
  std::vector<DriftSeen> earlier = {};   ///< the drift that earlier checks saw
};

/// check_health() with the same rules for all callers. `cell` gives the tolerance: the model's
/// cell, or the present cell file.
[[nodiscard]] Result<HealthCheck> check_robot(const CompensatedModel& model, const Cell& cell,
                                              const CheckedBatch& batch, CheckAsked asked);

}  // namespace trammel
