#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

/// Rows of a batch that give one number of an instrument (Gauge) instead of a position.
namespace trammel {

[[nodiscard]] bool has_gauges(const MeasurementBatch& batch);
/// True if some row has a position.
[[nodiscard]] bool has_positions(const MeasurementBatch& batch);
/// The rows that have a position. Indices and rows stay.
[[nodiscard]] MeasurementBatch positions_of(const MeasurementBatch& batch);

/// Refuses gauges for a task `who` (`diagnose`, `a check`) that works with positions alone.
[[nodiscard]] Status require_positions(const MeasurementBatch& batch, const std::string& who);

/// The contacts of `batch` as positions: the point that the tool met is the origin of their frame.
/// Empty if some row is no contact, or if the contacts are with several points.
[[nodiscard]] std::optional<MeasurementBatch> about_one_point(const MeasurementBatch& batch);

/// Resolves anchors, tools and payloads of the gauges, and gives a value without a sigma that of
/// its instrument. A point of contacts need not be in the cell file: a check needs no place of it.
/// Refuses another anchor that the cell file does not have, a touch of a point, a contact with a
/// surface, a reference pose with joints that the robot cannot have, and a missing anchor name if
/// the cell has several anchors. The caller adds file and row to errors.
[[nodiscard]] Status check_gauge(Measurement& measurement, const Cell& cell,
                                 const Anchors& anchors);

}  // namespace trammel
