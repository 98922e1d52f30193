#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/calibrate/sessions/session_setting.h"
#include "server/measurement/measurement.h"

/// The part of the normal equations that belongs to sessions: the place of each instrument, and its
/// scale. Each session has seven unknowns that it shares with no other. They are eliminated session
/// by session (Schur complement), so the cost is linear in the number of sessions.
namespace trammel {

inline constexpr int kOfSession = 7;
/// A small motion of the prediction in W: a shift (m), a turn (rad) and a stretch (of itself) about
/// `centre_W`.
using SessionMotion = Eigen::Matrix<double, kOfSession, 1>;
using SessionColumns = Eigen::Matrix<double, kOfSession, Eigen::Dynamic>;

/// Derivative of the weighted residuals (6, or 3 without an orientation) by the motion, transposed:
/// one column an equation. The derivative by the stretch is set to 0 unless the session is
/// `stretched`, so that the stretch stays 0.
[[nodiscard]] SessionColumns motion_columns(const Measurement& m, const Vector3& centre_W,
                                            double inverse_sigma, double inverse_rotation_sigma,
                                            bool stretched);

/// The normal equations of one session's motion.
struct SessionBlock {
  Eigen::Matrix<double, kOfSession, kOfSession> curvature =
      Eigen::Matrix<double, kOfSession, kOfSession>::Zero();
  SessionMotion gradient = SessionMotion::Zero();
  SessionColumns cross;  ///< 7 x P: with the shared parameters

  /// curvature^-1 times `right`; undetermined directions do not move.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& right, double damping = 0) const;
  /// The motion that goes with a step of the shared parameters.
  [[nodiscard]] SessionMotion motion(const Eigen::VectorXd& step, double damping = 0) const;
};

/// Leaves the shared parameters' normal equations once the sessions are eliminated.
void eliminate(const std::vector<SessionBlock>& blocks, Eigen::MatrixXd& information,
               Eigen::VectorXd& gradient, double damping = 0);

/// The change of measurements that equals this motion of the predictions.
[[nodiscard]] Similarity measured_by(const SessionMotion& motion, const Vector3& centre_W);

}  // namespace trammel
