#pragma once

#include <optional>
#include <vector>

#include "server/health/health_check.h"

namespace trammel {

/// The questions to a check beside its poses.
struct CheckAsked {
  std::optional<double> tolerance = {};  ///< m; empty: the cell's
  bool new_tool = false;                 ///< HealthOptions::new_tool
  std::vector<DriftSeen> earlier = {};   ///< what checks before it saw
};

/// check_health() as every door asks it. The tolerance is that of `cell`: the model's, or as its
/// file is now.
[[nodiscard]] Result<HealthCheck> check_robot(const CompensatedModel& model, const Cell& cell,
                                              const CheckedBatch& batch, CheckAsked asked);

}  // namespace trammel
