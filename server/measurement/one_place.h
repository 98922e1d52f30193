#pragma once

#include <Eigen/Dense>

#include "server/measurement/measurement.h"

/// Positions at one place: an arm that turns on a tip, in a cup or about a sphere.
namespace trammel {

/// m, rms distance of the points from their centroid; there is one point at least.
[[nodiscard]] double spread_of(const Eigen::Matrix3Xd& points);
/// True if the points lie within 50 mm rms of one place: an arm that is off by 3 mm is a turn of 3
/// degrees there, so that they hardly tell how anything is turned. No points are at no place.
[[nodiscard]] bool are_at_one_place(const Eigen::Matrix3Xd& points);
/// True if the positions of each tool lie at one place, with as many places as there are tools.
[[nodiscard]] bool is_each_tool_at_one_place(const MeasurementBatch& batch);

}  // namespace trammel
