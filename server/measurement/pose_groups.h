#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/measurement/measurement.h"

namespace trammel {

/// Rows (rising) that stand at one joint vector.
using PoseGroup = std::vector<Eigen::Index>;

/// The rows of `q` (N x n, rad or m) that stand at one joint vector, in the order of their first
/// row. Joints are equal that round to the same 1e-6: several reflectors of one pose, and repeats.
/// Such rows share the error of the arm, so they are left out, held out and counted together.
[[nodiscard]] std::vector<PoseGroup> pose_groups(const Eigen::MatrixXd& q);
[[nodiscard]] std::vector<PoseGroup> pose_groups(const std::vector<JointVector>& q);
[[nodiscard]] std::vector<PoseGroup> pose_groups(const MeasurementBatch& batch);

/// True if both are positions of one session, approached the same way: at one joint vector the arm
/// is off by the same.
[[nodiscard]] bool are_seen_together(const Measurement& a, const Measurement& b);
/// The rows of `batch` by joint vector, those that are not seen together apart.
[[nodiscard]] std::vector<PoseGroup> groups_seen_together(const MeasurementBatch& batch);
/// The number of rows that are seen together with each row, itself counted; empty where all are
/// alone. Gauges see the arm from different sides, and are alone.
[[nodiscard]] std::vector<int> counted_together(const MeasurementBatch& batch);

}  // namespace trammel
