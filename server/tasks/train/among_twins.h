#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/calibrate/calibrate.h"
#include "server/fleet/fleet_prior.h"

namespace trammel {

/// calibrate() with the fleet's means and spreads as priors of the arm's parameters. If the poses
/// alone put a parameter farther from the twins than they differ (unlike_twins()), it gets its
/// source's own prior. This is done one by one, the farthest first, until no such parameter is
/// left, so an odd robot is not drawn towards its twins. If the twins' priors leave clearly larger
/// residuals than the poses alone, they are not used at all.
[[nodiscard]] Result<CalibrationResult> calibrate_among_twins(
    const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& sources,
    const MeasurementBatch& batch, const FleetPrior& fleet);

}  // namespace trammel
