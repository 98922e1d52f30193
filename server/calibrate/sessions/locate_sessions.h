#pragma once

#include "server/calibrate/sessions/session_setting.h"
#include "server/error_sources/physical_model.h"

namespace trammel {

/// Where the instrument of each session stood, by the nominal chain and the tools that the cell or
/// another session tells: within millimetres, enough to start from. Refuses a session whose rows do
/// not tell it.
[[nodiscard]] Result<std::vector<SessionSetting>> locate_sessions(const PhysicalModel& model,
                                                                  const MeasurementBatch& batch);

}  // namespace trammel
