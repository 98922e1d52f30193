#pragma once

#include <map>
#include <string>

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

/// Finds the orders of periodic sources where nobody gave them.
namespace trammel {

/// Finds the orders one source after the other, the strongest first, each by a periodogram of the
/// model's residuals. The found values become starting values and centres of the priors; amplitudes
/// stay free.
[[nodiscard]] Status search_orders(CalibrationProblem& problem, const CalibrateOptions& options);

/// `name@order` for each searched source, by name: specs that need no search.
[[nodiscard]] std::map<std::string, std::string> found_orders(const PhysicalModel& model);

/// `source`, whose order nobody gave, spelled with the order that explains most of what `found`
/// leaves of `batch`.
[[nodiscard]] std::string with_likeliest_order(const ErrorSource& source,
                                               const CalibrationResult& found,
                                               const MeasurementBatch& batch);

}  // namespace trammel
