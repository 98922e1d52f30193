#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"
#include "server/calibrate/causes/cause_choice.h"

namespace trammel {

struct ChosenCauses {
  std::vector<std::string> sources;  ///< the sources to identify: those kept, and those taken
  CauseChoice choice;
};

/// The causes that `batch` shows, beside base, geometry, tools and `kept` (README.md). All kept
/// causes stay. Refuses as calibrate(). `go_on` gets the finished share; the choice is also refused
/// if it returns false.
[[nodiscard]] Result<ChosenCauses> choose_causes(
    const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& kept,
    const MeasurementBatch& batch,
    const std::function<Status(double share)>& go_on = [](double) { return Status(); });

}  // namespace trammel
