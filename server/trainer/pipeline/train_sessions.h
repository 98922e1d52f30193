#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/calibrate/calibrate.h"
#include "server/calibrate/changes.h"
#include "server/compensate/model_parts.h"
#include "server/measurement/split.h"

/// Training from several sessions of one arm.
namespace trammel {

/// Takes the sessions out of `split` whose training rows do not tell where their instrument stood; returns them.
[[nodiscard]] std::vector<LeftOutSession> leave_out_unplaced(BatchSplit& split);

struct IdentifiedSessions {
  CalibrationResult calibration;
  std::vector<Change> changes;  ///< of the arm between sessions, in the order in which they were found
};
/// calibrate() of the batch with these sources.
using Identify = std::function<Result<CalibrationResult>(const std::vector<std::string>& sources)>;
/// Identifies `sources` on `batch` and, where it has several sessions, what changed between them: while one change is
/// beyond chance it joins the sources, and only what it changes starts anew from its session on. `go_on`: false gives
/// up. Refusals as calibrate().
[[nodiscard]] Result<IdentifiedSessions> identify_sessions(const Identify& identify,
                                                           const std::vector<std::string>& sources,
                                                           const MeasurementBatch& batch,
                                                           const std::function<bool(double share)>& go_on);

}  // namespace trammel
