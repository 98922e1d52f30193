#pragma once

#include <functional>

#include "server/compensate/correction.h"

/// Corrections by steps of the joints, for places where the tool cannot move in every way: its
/// point reaches its target, and it turns as far as it can.
namespace trammel {

/// Target pose minus predicted pose of the tool with the arm at these joints, in B: m, rad. `anew`:
/// computes the bias there; otherwise reuses its last value.
using MissingAt = std::function<Vector6(const JointVector& q, bool anew)>;

struct CorrectedJoints {
  JointVector q;
  Vector6 missing;  ///< m, rad
  int iterations = 0;
  bool settled = false;
};

/// The step from the joints `q`, which are `so_far` from the start, given the remaining difference.
using JointStep = std::function<JointVector(const JointVector& q, const JointVector& so_far,
                                            const Vector6& missing)>;

/// Takes steps from `start` (a copy, since `missing_at` may write to the caller's vector) until
/// they are negligible and the point is on its target.
[[nodiscard]] CorrectedJoints settle_joints(JointVector start, const Vector6& missing_at_start,
                                            const JointStep& next, const MissingAt& missing_at,
                                            double tolerance, int max_iterations);

/// The d that minimises ½ dᵀ H d - gᵀ d under  held d = values.  H: n x n, held: m x n.
[[nodiscard]] Eigen::VectorXd least_with_held(const Eigen::MatrixXd& H, const Eigen::VectorXd& g,
                                              const Eigen::MatrixXd& held,
                                              const Eigen::VectorXd& values);

}  // namespace trammel
