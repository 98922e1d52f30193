#include "server/diagnose/evidence/play_sign.h"

#include <cmath>

#include "server/base/coverage.h"
#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/thresholds.h"
#include "server/robot/arm_state.h"

namespace trammel::cause_search {

namespace {

/// b and k of b + k |tau|, SI, with their covariance.
struct Play {
  Eigen::Vector2d value;
  Eigen::Matrix2d covariance;
};

Play play_of(const LinearProblem& problem, const std::string& source, const Eigen::VectorXd& change,
             const Eigen::MatrixXd& covariance) {
  const std::vector<Eigen::Index> places = places_of_source(problem.model(), source);
  Eigen::Vector2d value, scale;
  for (Eigen::Index k = 0; k < 2; ++k) {
    const Eigen::Index place = places[static_cast<std::size_t>(k)];
    scale(k) = problem.nuisance_parameters()[static_cast<std::size_t>(place)].prior_scale;
    value(k) = problem.model().values(place) + scale(k) * change(place);
  }
  return {value,
          scale.asDiagonal() * Eigen::Matrix2d(covariance(places, places)) * scale.asDiagonal()};
}

/// (1, |tau|) at every pose that was approached from a known side of the joint.
std::vector<Eigen::Vector2d> directed_poses(const LinearProblem& problem, int joint) {
  std::vector<Eigen::Vector2d> poses;
  for (const Measurement& m : problem.batch().measurements) {
    if (m.context.direction.empty() || m.context.direction[static_cast<std::size_t>(joint)] == 0)
      continue;
    const double torque = ArmKinematics(problem.model().state(m.context)).gravity_torque()(joint);
    poses.emplace_back(1, std::abs(torque));
  }
  return poses;
}

}  // namespace

PlaySign sign_of_play(const LinearProblem& problem, const std::string& source, int joint,
                      const Eigen::VectorXd& change, const Eigen::MatrixXd& covariance) {
  const Play play = play_of(problem, source, change, covariance);
  const std::vector<Eigen::Vector2d> poses = directed_poses(problem, joint);
  if (poses.empty()) return {joint, 0, 0, false};
  const auto stddev = [&](const Eigen::Vector2d& pose) {
    return std::sqrt(pose.dot(play.covariance * pose));
  };
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double negative = 0;
  for (const Eigen::Vector2d& pose : poses) {
    mean += pose;
    if (pose.dot(play.value) < -thresholds::kWrongSignOfPose * stddev(pose)) ++negative;
  }
  const auto directed = static_cast<double>(poses.size());
  mean /= directed;
  PlaySign sign{joint, mean.dot(play.value), stddev(mean), false};
  sign.negative = sign.mean < -thresholds::kWrongSign * sign.stddev ||
                  negative > thresholds::kPosesOfWrongSign * directed;
  return sign;
}

std::string what_negative_play_may_be(const std::vector<PlaySign>& negative, bool every) {
  std::vector<std::string> joints;
  for (const PlaySign& one : negative) {
    joints.push_back(fmt::format("joint {} ({:.0f} ± {:.0f} urad)", one.joint + 1, 1e6 * one.mean,
                                 1e6 * kExpanded * one.stddev));
  }
  const std::string text = fmt::format(
      "coming from its side of approach {} runs ahead where play would hang back: this is no play, "
      "and no gear is to be adjusted; were joints read or measured before they stood still, does a "
      "servo overshoot or lag, or ",
      fmt::join(joints, " as well as "));
  if (!every || negative.size() < 2)
    return text + fmt::format("is the dir{} column of the wrong sign?", negative.front().joint + 1);
  return text + "are the dir columns reversed? So it is in every joint that shows anything";
}

}  // namespace trammel::cause_search
