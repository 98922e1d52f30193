#pragma once

#include <functional>

#include "server/compensate/correction.h"

/// Corrections by steps of the joints, where the tool cannot be moved in every way: its point comes
/// to where it is wanted, and turns as far as it can be turned.
namespace trammel {

/// Wanted - predicted pose of the tool with the arm at these joints, in B: m, rad. `anew`: what was
/// learned is asked for there; else it is taken from where it was asked for last.
using MissingAt = std::function<Vector6(const JointVector& q, bool anew)>;

struct CorrectedJoints {
  JointVector q;
  Vector6 missing;  ///< m, rad
  int iterations = 0;
  bool settled = false;
};

/// The step to take from the joints `q`, `so_far` from the start, where so much is missing.
using JointStep = std::function<JointVector(const JointVector& q, const JointVector& so_far,
                                            const Vector6& missing)>;

/// Takes steps from `start` (a copy: `missing_at` may write to where the caller has it) until they
/// are next to nothing and the point is where it is wanted.
[[nodiscard]] CorrectedJoints settle_joints(JointVector start, const Vector6& missing_at_start,
                                            const JointStep& next, const MissingAt& missing_at,
                                            double tolerance, int max_iterations);

/// The d for which ½ dᵀ H d - gᵀ d is least among those with  held d = values.  H: n x n, held: m x
/// n.
[[nodiscard]] Eigen::VectorXd least_with_held(const Eigen::MatrixXd& H, const Eigen::VectorXd& g,
                                              const Eigen::MatrixXd& held,
                                              const Eigen::VectorXd& values);

}  // namespace trammel
