#pragma once

#include <optional>
#include <string>

#include "server/compensate/accuracy.h"

namespace trammel {

/// `Good to 0.082 mm at 95 % in this volume; not known beyond; check again by 2026-12-23.` Rounded
/// up. Where joints came from one side, where no pose was held out, and where nothing is known, it
/// says so.
[[nodiscard]] std::string promise_sentence(const CompensatedModel& model,
                                           const std::optional<PositionAccuracy>& accuracy);

/// Why nothing can be promised, where the poses do not tell: those of `batch` are foreign_poses(),
/// or what is left of the measured coordinates once the parameters are taken from them is too
/// little to show how far the model is off. It says what to do. `accuracy` stands then for nothing.
[[nodiscard]] std::optional<std::string> why_no_promise(
    const CompensatedModel& model, const std::optional<PositionAccuracy>& accuracy,
    const std::optional<MeasurementBatch>& batch);

/// The first page, as HTML: what a certificate says of robot, instrument, operator, dates and
/// volume; the promise in the terms of ISO 9283 (Manipulating industrial robots: performance
/// criteria), against the tolerance of the cell file and against usual ones. `batch`: repeats in it
/// tell the repeatability.
[[nodiscard]] std::string certificate(const CompensatedModel& model,
                                      const std::optional<PositionAccuracy>& accuracy,
                                      const std::optional<MeasurementBatch>& batch);

/// `0.082`, mm of a length in m: two digits, never smaller than it is.
[[nodiscard]] std::string rounded_up_mm(double length);

}  // namespace trammel
