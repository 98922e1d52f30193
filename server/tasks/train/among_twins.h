#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/calibrate/calibrate.h"
#include "server/fleet/fleet_prior.h"

namespace trammel {

/// calibrate() with the fleet's means and spreads as priors of the arm's parameters. A parameter
/// that the poses by themselves put farther from the twins than they differ (unlike_twins()) has
/// its source's own prior, one after the other, the farthest first, until none is: an odd robot is
/// not drawn towards its twins. Where the twins' priors leave clearly more than the poses by
/// themselves do, they are not used at all.
[[nodiscard]] Result<CalibrationResult> calibrate_among_twins(
    const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& sources,
    const MeasurementBatch& batch, const FleetPrior& fleet);

}  // namespace trammel
