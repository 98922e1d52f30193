#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Identifies the parameters of the model's sources by maximum a posteriori (source section 3.3.2):
/// Gaussian priors, residuals in units of sigma, orientation errors as rotation vectors. Where the
/// model leaves more than the measurement's sigma, the surplus is estimated as a discrepancy and
/// added to sigma: positions, orientations, good and bad points keep their proper weights. Refuses
/// a source whose needs no pose meets, a base or tool that the data do not determine, and joints
/// that do not lead to the positions (more than 25 mm rms and 5 % of their spread are left).
[[nodiscard]] Result<CalibrationResult> calibrate(const CalibrationProblem& problem,
                                                  const CalibrateOptions& options);

/// Calibrates `cell` with the sources that `specs` name. Of a cause with several forms the one is
/// kept under which the data are most likely; all forms have the same number of parameters. With
/// `weigh_links` the data may add causes: `self_weight` beside `compliance` of a robot without told
/// link masses, and `thermal_growth` beside `geometry` of three sessions and more at different
/// temperatures, where that is 20 nat more likely, or makes scales of the sessions superfluous.
[[nodiscard]] Result<CalibrationResult> calibrate(const std::shared_ptr<const Cell>& cell,
                                                  const std::vector<std::string>& specs,
                                                  const MeasurementBatch& batch,
                                                  const CalibrateOptions& options);

}  // namespace trammel
