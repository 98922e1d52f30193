#pragma once

#include "server/base/result.h"
#include "server/robot/pose.h"

namespace trammel {

/// The rigid transformation X_AB that takes `points_B` onto `points_A` (3 x N each, N >= 3) with
/// least squares, by SVD, eqs. (3.8)-(3.10) written for the direct map. Refuses fewer than 3 points
/// and points on a line.
[[nodiscard]] Result<Pose> fit_transform(const Eigen::Matrix3Xd& points_A,
                                         const Eigen::Matrix3Xd& points_B);

}  // namespace trammel
