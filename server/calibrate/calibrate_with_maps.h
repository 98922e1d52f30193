#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/calibrate/calibrate.h"

namespace trammel {

/// calibrate() with `specs`. A map without stated harmonics (`joint_map:2`, `joint_map:*`) gets the
/// number and the prior size of harmonics that make the batch most probable (maps/README.md). The
/// result spells them out: `joint_map:2@110+312.5+1.84+1.02`. Refusals as calibrate().
[[nodiscard]] Result<CalibrationResult> calibrate_with_maps(const std::shared_ptr<const Cell>& cell,
                                                            const std::vector<std::string>& specs,
                                                            const MeasurementBatch& batch,
                                                            const CalibrateOptions& options);

}  // namespace trammel
