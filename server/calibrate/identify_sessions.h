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
      changes;  ///< changes of the arm between sessions, in the order in which they were found
};
/// A function that calibrates the batch with these sources.
using Identify = std::function<Result<CalibrationResult>(const std::vector<std::string>& sources)>;
/// Identifies `sources` on `batch` and, if it has several sessions, the changes between them. As
/// long as a change is beyond chance, it joins the sources, and the parameters that it changes
/// start anew from its session on. Refuses in the cases of calibrate(), and when `go_on` gives up.
[[nodiscard]] Result<IdentifiedSessions> identify_sessions(
    const Identify& identify, const std::vector<std::string>& sources,
    const MeasurementBatch& batch, const std::function<Status(double share)>& go_on);

}  // namespace trammel
