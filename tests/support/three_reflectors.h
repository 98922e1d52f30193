#pragma once

#include <cstdint>
#include <memory>

#include "server/measurement/measurement.h"
#include "server/robot/cell.h"

/// The shipped virtual robot with three reflectors at its flange, all measured at each pose.
namespace trammel::test {

/// cell-7 with the tools a, b and c, some 0.1 m apart.
[[nodiscard]] std::shared_ptr<const Cell> cell_of_three_reflectors();
/// Their positions, pose by pose, without orientations. At each pose the arm is off by a random
/// shift of `shared` (m per axis), common to all three; `apart`: the error of each by itself beside
/// the tracker's noise.
[[nodiscard]] MeasurementBatch seen_by_three(int poses, double shared, double apart,
                                             std::uint64_t seed);
/// The rows of reflector a.
[[nodiscard]] MeasurementBatch seen_by_one(const MeasurementBatch& by_three);

}  // namespace trammel::test
