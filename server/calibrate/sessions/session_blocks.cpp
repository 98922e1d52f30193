#include "server/calibrate/sessions/session_blocks.h"

namespace trammel {

namespace {

// Prior standard deviations of an instrument's place about the located one, so wide that they have
// no influence.
constexpr double kShift = 1;   // m
constexpr double kTurn = 2.5;  // rad
constexpr double kStretch = 1;

}  // namespace

SessionColumns motion_columns(const Measurement& m, const Vector3& centre_W, double inverse_sigma,
                              double inverse_rotation_sigma, bool stretched) {
  const Eigen::Index rows = m.R_WT ? 6 : 3;
  SessionColumns columns = SessionColumns::Zero(kOfSession, rows);
  // d(w x r) = -skew(r) w, and the residual is measured - predicted. The measured r is precise
  // enough.
  columns.topLeftCorner<3, 3>() = -inverse_sigma * Matrix3::Identity();
  columns.block<3, 3>(3, 0) = inverse_sigma * skew(m.p_W - centre_W).transpose();
  if (stretched) columns.block<1, 3>(6, 0) = -inverse_sigma * (m.p_W - centre_W).transpose();
  if (m.R_WT) columns.block<3, 3>(3, 3) = -inverse_rotation_sigma * Matrix3::Identity();
  return columns;
}

Eigen::MatrixXd SessionBlock::solve(const Eigen::MatrixXd& right, double damping) const {
  Eigen::Matrix<double, kOfSession, kOfSession> regular = curvature;
  regular.diagonal() *= 1 + damping;
  regular.diagonal().head<3>().array() += 1 / (kShift * kShift);
  regular.diagonal().segment<3>(3).array() += 1 / (kTurn * kTurn);
  regular(6, 6) += 1 / (kStretch * kStretch);
  return regular.ldlt().solve(right);
}

SessionMotion SessionBlock::motion(const Eigen::VectorXd& step, double damping) const {
  return -solve(gradient + cross * step, damping);
}

void eliminate(const std::vector<SessionBlock>& blocks, Eigen::MatrixXd& information,
               Eigen::VectorXd& gradient, double damping) {
  for (const SessionBlock& block : blocks) {
    const Eigen::MatrixXd across = block.solve(block.cross, damping);
    information.noalias() -= block.cross.transpose() * across;
    gradient.noalias() -= across.transpose() * block.gradient;
  }
}

Similarity measured_by(const SessionMotion& motion, const Vector3& centre_W) {
  const Matrix3 back = rotation_exp(-motion.segment<3>(3));
  const double shrunk = 1 / (1 + motion(6));
  return {make_pose(back, centre_W - shrunk * (back * (centre_W + motion.head<3>()))), shrunk - 1};
}

}  // namespace trammel
