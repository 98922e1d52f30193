#pragma once

#include <Eigen/Dense>

#include "server/measurement/measurement.h"

/// Positions at one place: an arm that turns on a tip, in a cup or about a sphere.
namespace trammel {

/// m, rms distance of the points from their centroid; there is one point at least.
[[nodiscard]] double spread_of(const Eigen::Matrix3Xd& points);
/// True if the points lie within 50 mm rms of one place. There an arm error of 3 mm equals a turn
/// of 3 degrees, so the points hardly determine a rotation. False without points.
[[nodiscard]] bool are_at_one_place(const Eigen::Matrix3Xd& points);
/// True if the positions of each tool lie at one place, with as many places as there are tools.
[[nodiscard]] bool is_each_tool_at_one_place(const MeasurementBatch& batch);

}  // namespace trammel
