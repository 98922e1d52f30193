#pragma once

#include <array>
#include <optional>

#include "server/base/result.h"
#include "server/robot/chain.h"

/// Inverse kinematics of the nominal robot, as its controller computes it.
namespace trammel {

enum class InverseStatus {
  kOk,
  kJointLimit,   ///< reachable, but only outside the joint limits
  kUnreachable,  ///< no joints bring the flange there
  kSingular      ///< reached, where the arm cannot move in every direction
};

struct InverseResult {
  InverseStatus status = InverseStatus::kUnreachable;
  JointVector q;  ///< rad; the best found when not kOk
  int iterations = 0;
};

/// Joints for `X_BF` near `seed`: damped least squares (Levenberg-Marquardt) on [position; rotation
/// vector], kept within the limits. Converged means 1e-10 m and rad. Singular means the smallest
/// singular value of the Jacobian, lengths in metres, is below 1e-3.
[[nodiscard]] InverseResult inverse_kinematics(const Chain& chain, const Pose& X_BF,
                                               const JointVector& seed);

/// Judges joints that bring the flange to its target: kOk, kJointLimit or kSingular, as above.
[[nodiscard]] InverseResult judged_joints(const Chain& chain, const JointVector& q, int iterations);

/// True when the chain is an elbow arm with a spherical wrist (axes 2 and 3 parallel, axes 4, 5, 6
/// through one point), so that its eight branches have a closed form.
[[nodiscard]] bool has_spherical_wrist(const Chain& chain);

/// The branch of `X_BF` in closed form. `conf` is 0..7, numbered as ABB's cfx: +4 the wrist centre
/// is behind axis 1, +2 it is behind the lower arm, +1 joint 5 is negative. Joints turn to the
/// values nearest to `near` (zero when absent) that the limits allow. Refuses a chain without
/// spherical wrist and a conf outside 0..7.
[[nodiscard]] Result<InverseResult> inverse_kinematics(
    const Chain& chain, const Pose& X_BF, int conf,
    const std::optional<JointVector>& near = std::nullopt);

/// The joints of one branch, not held against limits and singular places. For an arm with a
/// spherical wrist; `conf` is 0..7. Empty where the flange cannot be brought there.
[[nodiscard]] std::optional<JointVector> joints_of_branch(const Chain& chain, const Pose& X_BF,
                                                          int conf,
                                                          const std::optional<JointVector>& near);

/// The branch that `q` is in, numbered as above. Refuses a chain without spherical wrist.
[[nodiscard]] Result<int> branch_of(const Chain& chain, const JointVector& q);

}  // namespace trammel
