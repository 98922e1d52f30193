#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Identifies the parameters of the model's sources by maximum a posteriori (source section 3.3.2),
/// with Gaussian priors, residuals in units of sigma, and orientation errors as rotation vectors.
/// If the model leaves more than the measurement's sigma, the surplus is estimated as a discrepancy
/// and added to sigma. So positions, orientations, good and bad points keep their proper weights.
/// Refuses a source that needs a quantity no pose has, and a base or tool that the data do not
/// determine. Refuses joints that do not belong to the positions (more than 25 mm rms and 5 % of
/// their spread are left).
[[nodiscard]] Result<CalibrationResult> calibrate(const CalibrationProblem& problem,
                                                  const CalibrateOptions& options);

/// Calibrates `cell` with the sources that `specs` name. For a cause with several forms it keeps
/// the form under which the data are most likely; all forms have equally many parameters. With
/// `weigh_links` the data may add two causes: `self_weight` beside `compliance` if the robot file
/// has no link masses, and `thermal_growth` beside `geometry` if three or more sessions had
/// different temperatures. A cause is added if the data become 20 nat more likely, or if it makes
/// scales of the sessions superfluous.
[[nodiscard]] Result<CalibrationResult> calibrate(const std::shared_ptr<const Cell>& cell,
                                                  const std::vector<std::string>& specs,
                                                  const MeasurementBatch& batch,
                                                  const CalibrateOptions& options);

}  // namespace trammel
