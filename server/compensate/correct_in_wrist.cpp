#include "server/compensate/correct_in_wrist.h"

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

// Within 6 deg of the singularity a turn of 1 mrad would need 10 mrad of joints 4 and 6 and more.
constexpr double kBorder = 0.105;
constexpr double kMostDamping =
    0.06;  // of the idle motion, at the singularity; the remaining rotation is more than its square
constexpr int kFreeSteps = 6;  // steps that choose the idle motion; then it is fixed, and the other
                               // joints settle
constexpr double kMostOfOpening =
    0.9;  // share of the opening that a correction may use: the wrist never opens to the other side

/// Whatever a correction asks for, cut smoothly so that it never reaches the whole opening.
double cut(double asked, double opening) {
  const double most = kMostOfOpening * std::abs(opening);
  const double free = most / 2;
  if (std::abs(asked) <= free) return asked;
  return std::copysign(free + (most - free) * std::tanh((std::abs(asked) - free) / (most - free)),
                       asked);
}

/// Steps of the joints: they bring the point to its target, and as much of the rotation as
/// possible: min |J_r d - e_r|² + λ² (idle · (so far + d))²  with  J_p d = e_p,  rails held. After
/// kFreeSteps steps idle · d = 0, since the remaining rotation would keep the idle motion from
/// settling.
class WristSteps {
 public:
  WristSteps(const Chain& robot, const Vector3& p_FT, const WristOpening& wrist)
      : robot_(robot), p_FT_(p_FT), wrist_(wrist) {
    const double share = std::abs(wrist.angle) / kBorder;
    const double damping = share < 1 ? kMostDamping * std::pow(1 - share * share, 2) : 0.0;
    square_ = damping * damping;
  }

  JointVector step(const JointVector& q, const JointVector& so_far, const Vector6& missing) {
    if (steps_++ == kFreeSteps) held_ = true;
    if (!opened_) {
      const double asked = wrist_.by_joint.dot(solve(q, so_far, missing, std::nullopt));
      const double allowed = cut(asked, wrist_.angle);
      opened_ = allowed == asked ? Opened{std::nullopt} : Opened{allowed};
    }
    return solve(q, so_far, missing, opened_->change);
  }

 private:
  struct Opened {
    std::optional<double> change;  ///< rad, of the wrist's angle in all; empty: as it comes
  };

  JointVector solve(const JointVector& q, const JointVector& so_far, const Vector6& missing,
                    const std::optional<double>& change) const {
    const Eigen::MatrixXd J = robot_.jacobian(q, p_FT_);
    const Eigen::MatrixXd turn = J.bottomRows<3>();
    const Eigen::Index n = J.cols();
    Eigen::MatrixXd held = J.topRows<3>();
    Eigen::VectorXd values = missing.head<3>();
    const auto hold = [&](const Eigen::VectorXd& row, double value) {
      held.conservativeResize(held.rows() + 1, n);
      held.row(held.rows() - 1) = row.transpose();
      values.conservativeResize(values.size() + 1);
      values(values.size() - 1) = value;
    };
    for (int j = 0; j < robot_.size(); ++j) {
      if (robot_.joint(j).type == JointType::kPrismatic) hold(Eigen::VectorXd::Unit(n, j), 0);
    }
    if (held_) hold(wrist_.idle, 0);
    if (change) hold(wrist_.by_joint, *change - wrist_.by_joint.dot(so_far));
    return least_with_held(
        turn.transpose() * turn + square_ * wrist_.idle * wrist_.idle.transpose(),
        turn.transpose() * missing.tail<3>() - square_ * wrist_.idle.dot(so_far) * wrist_.idle,
        held, values);
  }

  const Chain& robot_;
  const Vector3 p_FT_;
  const WristOpening& wrist_;
  double square_ = 0;
  int steps_ = 0;
  bool held_ = false;  ///< the idle motion is chosen
  std::optional<Opened> opened_;
};

}  // namespace

std::optional<WristOpening> closing_wrist(const Chain& robot, const JointVector& q) {
  return wrist_opening(robot, q, kBorder);
}

CorrectedJoints correct_in_wrist(const Chain& robot, const Pose& X_FT, const WristOpening& wrist,
                                 const JointVector& start, const Vector6& missing_at_start,
                                 const MissingAt& missing_at, const CorrectOptions& options) {
  WristSteps steps(robot, X_FT.translation(), wrist);
  const auto next = [&](const JointVector& q, const JointVector& so_far, const Vector6& missing) {
    return steps.step(q, so_far, missing);
  };
  return settle_joints(start, missing_at_start, next, missing_at, options.tolerance,
                       kFreeSteps + options.max_iterations);
}

}  // namespace trammel
