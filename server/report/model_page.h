#pragma once

#include <optional>
#include <string>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// A model as a page for people: its origin, its error at three levels, its parameters with U(k=2),
/// and the questions that the measurements leave open. HTML with everything inside; opens without a
/// network. `batch` is checked against the model's cell; without one the page shows the held-out
/// poses, or else those of the training.
[[nodiscard]] std::string model_page(const CompensatedModel& model,
                                     const std::optional<MeasurementBatch>& batch);

}  // namespace trammel
