#include "server/compensate/joint_steps.h"

namespace trammel {

namespace {

constexpr double kSettled = 1e-8;  // rad, of a step
constexpr double kRegular = 1e-12;

}  // namespace

CorrectedJoints settle_joints(JointVector start, const Vector6& missing_at_start,
                              const JointStep& next, const MissingAt& missing_at, double tolerance,
                              int max_iterations) {
  CorrectedJoints now{start, missing_at_start};
  bool asked_here = true;  // the bias was computed at `now`
  while (true) {
    const JointVector step = next(now.q, now.q - start, now.missing);
    const bool still = step.norm() < kSettled && now.missing.head<3>().norm() < tolerance;
    now.settled = still && asked_here;
    if (now.settled || now.iterations == max_iterations) return now;
    if (!still) {
      now.q += step;
      ++now.iterations;
    }
    asked_here = still;
    now.missing = missing_at(now.q, still);
  }
}

Eigen::VectorXd least_with_held(const Eigen::MatrixXd& H, const Eigen::VectorXd& g,
                                const Eigen::MatrixXd& held, const Eigen::VectorXd& values) {
  const Eigen::Index n = H.rows();
  const Eigen::Index m = held.rows();
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n + m, n + m);
  K.topLeftCorner(n, n) = H;
  K.topLeftCorner(n, n).diagonal().array() += kRegular;
  K.topRightCorner(n, m) = held.transpose();
  K.bottomLeftCorner(m, n) = held;
  Eigen::VectorXd right(n + m);
  right << g, values;
  return K.fullPivLu().solve(right).head(n);
}

}  // namespace trammel
