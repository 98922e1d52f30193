#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "server/compensate/accuracy.h"
#include "server/report/cell_needs.h"

namespace trammel {

/// `Good to 0.082 mm at 95 % in this volume; not known beyond; check again by 2026-12-23.` Rounded
/// up. The sentence also states if joints came from one side, if no pose was held out, and if
/// nothing is known.
[[nodiscard]] std::string promise_sentence(const CompensatedModel& model,
                                           const std::optional<PositionAccuracy>& accuracy,
                                           const NextCheck& next);

/// The reason why no accuracy can be stated, and the remedy. Either the poses of `batch` are
/// foreign_poses(), or the measured coordinates have too few degrees of freedom left to show the
/// model's error. `accuracy` is then meaningless.
[[nodiscard]] std::optional<std::string> why_no_promise(
    const CompensatedModel& model, const std::optional<PositionAccuracy>& accuracy,
    const std::optional<MeasurementBatch>& batch);

/// The first page, as HTML: robot, instrument, operator, dates and volume as on a certificate; the
/// stated accuracy in the terms of ISO 9283 (Manipulating industrial robots: performance criteria),
/// against the tolerance of the cell file and against usual ones. `batch`: its repeats give the
/// repeatability.
[[nodiscard]] std::string certificate(const CompensatedModel& model,
                                      const std::optional<PositionAccuracy>& accuracy,
                                      const std::optional<MeasurementBatch>& batch,
                                      const NextCheck& next);

/// The box that was measured and the region that is promised, in numbers, as a table. `scene`:
/// scene_json(), which draws them.
[[nodiscard]] std::string volume_table(const CompensatedModel& model,
                                       const nlohmann::ordered_json& scene);

/// `0.082`, mm of a length in m: two digits, never smaller than it is.
[[nodiscard]] std::string rounded_up_mm(double length);

}  // namespace trammel
