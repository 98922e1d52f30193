#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/measurement/measurement.h"

namespace trammel {

/// Rows (rising) at one joint vector.
using PoseGroup = std::vector<Eigen::Index>;

/// Groups the rows of `q` (N x n, rad or m) by joint vector, in the order of their first row.
/// Joints that round to the same 1e-6 are equal: several reflectors of one pose, or repeats. Such
/// rows share the arm's error, so they are left out, held out and counted together.
[[nodiscard]] std::vector<PoseGroup> pose_groups(const Eigen::MatrixXd& q);
[[nodiscard]] std::vector<PoseGroup> pose_groups(const std::vector<JointVector>& q);
[[nodiscard]] std::vector<PoseGroup> pose_groups(const MeasurementBatch& batch);

/// True if both are positions of one session at one joint vector, approached the same way, so that
/// they share the arm's error.
[[nodiscard]] bool are_seen_together(const Measurement& a, const Measurement& b);
/// Groups the rows of `batch` by are_seen_together().
[[nodiscard]] std::vector<PoseGroup> groups_seen_together(const MeasurementBatch& batch);
/// For each row, the number of rows that are seen together, the row itself included; empty if every
/// row is alone. Gauges see the arm from different sides, and are alone.
[[nodiscard]] std::vector<int> counted_together(const MeasurementBatch& batch);

}  // namespace trammel
