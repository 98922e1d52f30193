#pragma once

#include "server/compensate/compensated_model.h"

namespace trammel {

/// Whether the model was trained with the tool and the payload of this measurement, and both are still in its cell.
[[nodiscard]] bool knows(const CompensatedModel& model, const Measurement& m);

/// The rows that the model knows().
[[nodiscard]] MeasurementBatch known_rows(const CompensatedModel& model, const MeasurementBatch& batch);

}  // namespace trammel
