#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "server/measurement/measurement.h"
#include "server/robot/cell.h"

/// A campaign that brings the tool's tip to one point from all sides and measures it there.
namespace trammel::test {

/// A UR5; `base` and `tool` as the cell file has them, `model` likewise.
[[nodiscard]] std::shared_ptr<const Cell> cell_of_one_point(const std::string& base,
                                                            const std::string& tool,
                                                            const std::string& model);
inline const std::string kToolOfOnePoint = "{xyz_mm: [30, 0, 150], q_wxyz: [1, 0, 0, 0]}";

/// In `poses` attitudes the drawn tool's tip is at one point; the real tip is `off` (m, in F) from
/// the drawn one. It is measured by a tracker that sees the base at `X_WB`, with 0.02 mm of noise
/// an axis.
[[nodiscard]] MeasurementBatch one_point(const Cell& cell, const Vector3& off, const Pose& X_WB,
                                         int poses, std::uint64_t seed);

}  // namespace trammel::test
