#pragma once

#include <map>
#include <string>

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

/// Orders of periodic sources that nobody told.
namespace trammel {

/// Sources to be searched are found one after the other, the strongest first, each by a periodogram of what the model
/// found so far leaves over; their values in the model become the start and the centre of the priors (amplitudes stay
/// free).
[[nodiscard]] Status search_orders(CalibrationProblem& problem, const CalibrateOptions& options);

/// `name@order` of the sources that were searched, by their names: with these specs the search need not be repeated.
[[nodiscard]] std::map<std::string, std::string> found_orders(const PhysicalModel& model);

}  // namespace trammel
