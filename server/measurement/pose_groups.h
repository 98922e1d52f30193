#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/measurement/measurement.h"

namespace trammel {

/// Rows (rising) that stand at one joint vector.
using PoseGroup = std::vector<Eigen::Index>;

/// The rows of `q` (N x n, rad or m) that stand at one joint vector, in the order of their first row. Joints are equal
/// that round to the same 1e-6: several reflectors of one pose, and repeats. Such rows share the error of the arm, so
/// they are left out, held out and counted together.
[[nodiscard]] std::vector<PoseGroup> pose_groups(const Eigen::MatrixXd& q);
[[nodiscard]] std::vector<PoseGroup> pose_groups(const std::vector<JointVector>& q);
[[nodiscard]] std::vector<PoseGroup> pose_groups(const MeasurementBatch& batch);

}  // namespace trammel
