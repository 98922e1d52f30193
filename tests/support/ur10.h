#pragma once

#include <memory>
#include <string>

#include "server/measurement/measurement.h"
#include "server/robot/cell.h"

namespace trammel::test {

/// True if ../shared/data has the measured UR10.
[[nodiscard]] bool has_ur10();

/// Its cell: base and tool unknown.
[[nodiscard]] std::shared_ptr<const Cell> ur10_cell();

/// Series `name` (c or d). Poses with an id that ends in 7, 8 or 9 are held out; the batch has
/// every `held_stride`th of these. It has every `stride`th of the other poses, at most `training`.
[[nodiscard]] MeasurementBatch ur10_series(const std::string& name, int training = 1 << 30,
                                           int stride = 1, int held_stride = 1);

}  // namespace trammel::test
