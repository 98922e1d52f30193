#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/calibrate/calibrate.h"
#include "server/calibrate/changes.h"

/// Several sessions of one arm, identified together.
namespace trammel {

struct IdentifiedSessions {
  CalibrationResult calibration;
  std::vector<Change>
      changes;  ///< of the arm between sessions, in the order in which they were found
};
/// calibrate() of the batch with these sources.
using Identify = std::function<Result<CalibrationResult>(const std::vector<std::string>& sources)>;
/// Identifies `sources` on `batch` and, where it has several sessions, what changed between them:
/// while one change is beyond chance it joins the sources, and only what it changes starts anew
/// from its session on. Refusals as calibrate(), and as `go_on` where that gives up.
[[nodiscard]] Result<IdentifiedSessions> identify_sessions(
    const Identify& identify, const std::vector<std::string>& sources,
    const MeasurementBatch& batch, const std::function<Status(double share)>& go_on);

}  // namespace trammel
