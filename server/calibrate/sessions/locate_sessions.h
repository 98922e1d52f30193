#pragma once

#include "server/calibrate/sessions/session_setting.h"
#include "server/error_sources/physical_model.h"

namespace trammel {

/// The place of the instrument in each session, by the nominal chain and by tools that the cell or
/// another session determines. It is right to within millimetres, enough for a start. Refuses a
/// session whose rows do not determine it.
[[nodiscard]] Result<std::vector<SessionSetting>> locate_sessions(const PhysicalModel& model,
                                                                  const MeasurementBatch& batch);

}  // namespace trammel
