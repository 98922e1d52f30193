#pragma once

#include <optional>
#include <string>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// A model as a page for people: its origin, its error at three levels, its parameters with U(k=2),
/// and the questions that the measurements leave open. HTML with everything inside; opens without a
/// network. `batch` is checked against the model's cell; without one the page shows the held-out
/// poses, or else those of the training. `last_check`: of its robot, in the form of health_json(),
/// if one is on record; the next check is then due as it says.
[[nodiscard]] std::string model_page(const CompensatedModel& model,
                                     const std::optional<MeasurementBatch>& batch,
                                     const std::string& last_check = "");

}  // namespace trammel
