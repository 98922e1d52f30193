#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/calibrate/calibrate.h"

namespace trammel {

/// calibrate() with `specs`, of which a map that says nothing of its harmonics (`joint_map:2`,
/// `joint_map:*`) has as many, and of such a size, as the batch makes most probable
/// (maps/README.md). The result spells them: `joint_map:2@110+312.5+1.84+1.02`. Refusals as
/// calibrate().
[[nodiscard]] Result<CalibrationResult> calibrate_with_maps(const std::shared_ptr<const Cell>& cell,
                                                            const std::vector<std::string>& specs,
                                                            const MeasurementBatch& batch,
                                                            const CalibrateOptions& options);

}  // namespace trammel
