#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/measurement/measurement.h"

/// The part of the normal equations that belongs to sessions: where the instrument of each stood. Each session has six
/// unknowns of its own that no other one shares, so they are eliminated session by session (Schur complement), and the
/// cost is linear in the sessions.
namespace trammel {

/// A small motion (m, rad) of the prediction in W: a shift, and a turn about `centre_W`.
using SessionMotion = Vector6;

/// Derivative of the weighted residuals (6, or 3 without an orientation) by the motion, 6 columns, transposed: one
/// column an equation.
[[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> motion_columns(const Measurement& m, const Vector3& centre_W,
                                                                      double inverse_sigma,
                                                                      double inverse_rotation_sigma);

/// The normal equations of one session's motion.
struct SessionBlock {
  Eigen::Matrix<double, 6, 6> curvature = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6 gradient = Vector6::Zero();
  Eigen::Matrix<double, 6, Eigen::Dynamic> cross;  ///< 6 x P: with the shared parameters

  /// curvature^-1 times `right`; directions that the rows do not show stay where they are.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& right, double damping = 0) const;
  /// The motion that goes with a step of the shared parameters.
  [[nodiscard]] SessionMotion motion(const Eigen::VectorXd& step, double damping = 0) const;
};

/// What is left of the shared parameters' normal equations once the sessions are eliminated.
void eliminate(const std::vector<SessionBlock>& blocks, Eigen::MatrixXd& information, Eigen::VectorXd& gradient,
               double damping = 0);

/// The rigid motion of what was measured that equals this motion of what is predicted.
[[nodiscard]] Pose measured_by(const SessionMotion& motion, const Vector3& centre_W);

}  // namespace trammel
