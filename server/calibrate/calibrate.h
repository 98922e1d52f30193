#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Identifies the parameters of the model's sources by maximum a posteriori (Gaussian priors in the parameters' own
/// scales, residuals in units of sigma), source section 3.3.2. Orientation errors are rotation vectors. Where the model
/// cannot reach the measurement's sigma, the surplus is estimated as a discrepancy and added to it, so that positions
/// and orientations, good and bad points keep their proper weights. Refuses: fewer equations than identifiable
/// parameters; a base or tool that the data cannot determine; joints that do not lead to the positions (more than 25 mm
/// rms and 5 % of their spread are left).
[[nodiscard]] Result<CalibrationResult> calibrate(const CalibrationProblem& problem, const CalibrateOptions& options);

/// Calibrates `cell` with the sources that `specs` name. Where a cause has several forms, the one under which the data
/// are likeliest is kept (all have the same number of parameters).
[[nodiscard]] Result<CalibrationResult> calibrate(const std::shared_ptr<const Cell>& cell,
                                                  const std::vector<std::string>& specs, const MeasurementBatch& batch,
                                                  const CalibrateOptions& options);

}  // namespace trammel
