#pragma once

#include <memory>
#include <string>

#include "server/measurement/measurement.h"
#include "server/robot/cell.h"
#include "server/simulate/simulate.h"
#include "tests/support/from_rows.h"

/// The shipped virtual robot, measured. Tests see its batches; its truth stays inside the
/// simulator.
namespace trammel::test {

[[nodiscard]] std::shared_ptr<const Cell> cell_7();
/// cell-7 with base and tool unknown, for data as they arrive from a shop floor.
[[nodiscard]] std::shared_ptr<const Cell> cell_7_unlocated();
[[nodiscard]] VirtualRobot chapter_5_robot(const std::shared_ptr<const Cell>& cell);
/// The robot with the zero of a joint (1-based) off by that much.
[[nodiscard]] VirtualRobot with_zero_off(VirtualRobot robot, int joint, double rad);
/// The robot on a day with that recorded temperature (degrees Celsius), with links that grow by so
/// much (1/K).
[[nodiscard]] VirtualRobot in_warmth(VirtualRobot robot, double temperature, double growth);
/// `poses` poses of the cell's ranges as its tracker measures them.
[[nodiscard]] MeasurementBatch measured(const VirtualRobot& robot, int poses, std::uint64_t seed,
                                        bool orientation = true);

}  // namespace trammel::test
