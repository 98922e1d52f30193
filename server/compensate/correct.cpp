#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/compensate/arm_steps.h"
#include "server/compensate/compensated_model.h"
#include "server/compensate/correct_in_wrist.h"
#include "server/compensate/few_joints.h"
#include "server/compensate/take_ups.h"
#include "server/measurement/pose_columns.h"
#include "server/robot/branch_hint.h"
#include "server/robot/flange_motion.h"
#include "server/robot/inverse_kinematics.h"
#include "server/robot/wrist.h"

namespace trammel {

namespace {

constexpr double kRotationTolerance = 1e-7;  // rad: 0.1 µm at 1 m
constexpr int kHighestConf = 7;              // three signs, inverse_kinematics.h
constexpr int kJointsNamed = 2;   // joints outside their limits that a message names: more are not
                                  // read
constexpr int kDecimalsTold = 9;  // more than a controller takes
constexpr double kTurnTold = 1e-6;  // rad: a smaller remaining rotation is not reported

/// A joint value with enough decimals to differ from the limit that it exceeds.
std::string told_from(double limit, double value) {
  if (std::abs(value) > 1e6) return fmt::format("{:.6g}", value);
  std::string text;
  for (int decimals = 1; decimals <= kDecimalsTold; ++decimals) {
    text = fmt::format("{:.{}f}", value, decimals);
    if (std::abs(std::stod(text) - limit) > 0.5 * std::abs(value - limit)) break;
  }
  return text;
}

std::string limit_text(const Joint& joint, int number, double value) {
  const double limit = value < joint.lower ? joint.lower : joint.upper;
  const double limit_shown = joint_to_column(limit, joint.type);
  return fmt::format("joint {} would be at {} {}, limit {:.6g}", number,
                     told_from(limit_shown, joint_to_column(value, joint.type)),
                     joint.type == JointType::kRevolute ? "deg" : "mm", limit_shown);
}

/// `joint 5 would be at 121.3 deg, limit 120`, of each joint outside its limits.
std::string limits_text(const Chain& robot, const JointVector& q) {
  constexpr double kTolerance = 1e-9;  // as Chain::joint_outside_limits()
  std::vector<std::string> outside;
  for (int i = 0; i < robot.size(); ++i) {
    const Joint& joint = robot.joint(i);
    if (q(i) < joint.lower - kTolerance || q(i) > joint.upper + kTolerance)
      outside.push_back(limit_text(joint, i + 1, q(i)));
  }
  const auto named = std::min<std::size_t>(outside.size(), kJointsNamed);
  const std::string text =
      fmt::format("{}", fmt::join(outside.begin(), outside.begin() + named, "; "));
  return outside.size() == named ? text
                                 : fmt::format("{} and {} more", text, outside.size() - named);
}

CorrectionStatus status_of(InverseStatus status) {
  switch (status) {
    case InverseStatus::kJointLimit:
      return CorrectionStatus::kJointLimit;
    case InverseStatus::kSingular:
      return CorrectionStatus::kSingular;
    default:
      return CorrectionStatus::kUnreachable;
  }
}

std::string direction_text(const Vector3& direction_B) {
  const Vector3 d = direction_B.normalized();
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", d.x(), d.y(), d.z());
}

/// The direction in which the flange cannot move, in the base. With fewer than six joints it is one
/// of the directions that the joints do have.
std::string immovable(const Chain& robot, const JointVector& q) {
  const Eigen::MatrixXd J = flange_motion(robot, q).jacobian;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(J, Eigen::ComputeFullU);
  const Vector6 lost = svd.matrixU().col(std::min<Eigen::Index>(J.cols(), 6) - 1);
  if (lost.tail<3>().norm() > lost.head<3>().norm())
    return "it cannot turn about " + direction_text(lost.tail<3>()) + " of its base";
  return "it cannot move along " + direction_text(lost.head<3>()) + " of its base";
}

/// The part of a rotation that the arm cannot turn away; empty: nothing.
std::string turn_left(const Chain& robot, const Vector3& missing_B) {
  if (missing_B.norm() < kTurnTold) return "";
  return fmt::format(
      "{} {:.4f} deg about {} of the base are left",
      has_few_joints(robot) ? fmt::format("with {} joints", robot.size()) : "at a singular wrist",
      to_deg(missing_B.norm()), direction_text(missing_B));
}

/// True if the arm passes a singularity, into another configuration, between these joints. At two
/// near places the Jacobians then differ in the sign of one motion.
bool changes_configuration(const Chain& robot, const JointVector& from, const JointVector& to) {
  const Eigen::MatrixXd before = flange_motion(robot, from).jacobian;
  const Eigen::MatrixXd after = flange_motion(robot, to).jacobian;
  const Eigen::MatrixXd both = before.cols() > before.rows()
                                   ? Eigen::MatrixXd(before * after.transpose())
                                   : before.transpose() * after;
  return both.determinant() < 0;
}

/// Why these joints do not bring the tool to `X_BT`.
std::string why_not(const Chain& robot, const Pose& X_BT, const Pose& X_FT,
                    const InverseResult& joints, const std::optional<int>& conf) {
  switch (joints.status) {
    case InverseStatus::kJointLimit:
      return limits_text(robot, joints.q);
    case InverseStatus::kSingular:
      return "the arm is singular there: " + immovable(robot, joints.q);
    default:
      if (has_few_joints(robot) && point_is_reached(robot, X_BT, X_FT, joints.q)) {
        const Vector3 missing_B =
            pose_difference(X_BT, robot.flange_pose(joints.q) * X_FT).tail<3>();
        return fmt::format(
            "the arm has {} joints and cannot turn the tool so: {:.4f} deg about {} of its base "
            "are missing",
            robot.size(), to_deg(missing_B.norm()), direction_text(missing_B));
      }
      return conf ? fmt::format("no joints of conf {} bring the tool there", *conf)
                  : "no joints bring the tool there";
  }
}

/// The message of a target out of domain.
std::string corrected_by(const std::optional<BiasModel>& bias, double weight) {
  const bool has_blocks = bias && bias->has_blocks();
  return fmt::format(
      "too far from the training poses: corrected by the calibrated model{} and {:.0f} % of {}",
      has_blocks ? ", the blocks of the bias" : "", 100 * weight,
      has_blocks ? "its kernel" : "the learned bias");
}

/// The remark on a model that alone would promise less error than the arm can reach; empty if it
/// does not.
std::string below_resolution(const CompensatedModel& model, const PoseContext& context,
                             const ErrorPrediction& at) {
  constexpr double kAtTheFloor = 1 + 1e-9;
  const double least = least_rms(model, context);
  if (least <= 0 || at.true_stddev_B.norm() > kAtTheFloor * least) return "";
  return fmt::format("below resolution: the arm's smallest step is {:.3g} mm, less is not promised",
                     to_mm(smallest_step(model, context)));
}

/// `a; b`, without empty parts.
std::string both_said(std::string a, const std::string& b) {
  if (!a.empty() && !b.empty()) a += "; ";
  return a + b;
}

/// The way in which the arm comes to the target.
PoseContext way_to(const Target& target, const std::string& tool, const std::string& payload) {
  PoseContext context;
  context.tool = tool;
  context.payload = payload;
  context.direction = target.direction;
  context.temperature = target.temperature;
  context.time = target.time;
  context.served = true;
  return context;
}

/// The approach to `q`. A stated side of approach means a move of kSaidMove.
void come_as_said(const Chain& robot, const JointVector& q, PoseContext& context) {
  context.q = q;
  if (context.direction.empty() || context.before) return;
  JointVector way(robot.size());
  for (int j = 0; j < robot.size(); ++j)
    way(j) = kSaidMove * context.direction[static_cast<std::size_t>(j)];
  if (way.norm() > 0) context.before = context.q - robot.commanded(way);
}

/// Deviation of one measurement where the true position has this stddev an axis.
double measured(double stddev, double sigma) { return std::hypot(stddev, sigma); }

/// rms of an error with this mean, whose true value has this standard deviation.
double rms(const Vector3& mean, const Vector3& stddev) {
  return std::sqrt(mean.squaredNorm() + stddev.squaredNorm());
}

/// The rms of a rotation vector, rad; `stddev` is that of one measurement by an instrument with
/// this sigma.
double turn_rms(const Vector3& mean, const std::optional<Vector3>& stddev, double sigma) {
  if (!stddev) return mean.norm();
  return std::sqrt(mean.squaredNorm() + (stddev->array().square() - sigma * sigma).max(0.0).sum());
}

/// Sets the error to expect without correction.
void expect_before(const ErrorPrediction& before, const Tracker& tracker, Correction& result) {
  result.error_before = rms(before.X_BT_predicted.translation() - result.X_BT_wanted.translation(),
                            before.true_stddev_B);
  result.error_after = result.error_before;
  result.stddev = before.true_stddev_B.norm() / std::sqrt(3.0);
  result.measured_stddev = measured(result.stddev, tracker.sigma);
  result.turn_before =
      turn_rms(pose_difference(result.X_BT_wanted, before.X_BT_predicted).tail<3>(),
               before.rotation_stddev_B, tracker.sigma_rotation);
  result.turn_after = result.turn_before;
}

/// Sets the error to expect where this much of the way is missing still. The deviation is that at
/// the target: a correction moves it by far less than it is known.
void expect_after(const ErrorPrediction& before, const Vector6& missing, const Tracker& tracker,
                  Correction& result) {
  result.error_after = rms(missing.head<3>(), before.true_stddev_B);
  result.stddev = result.error_after / std::sqrt(3.0);
  result.measured_stddev = measured(result.stddev, tracker.sigma);
  result.turn_after = turn_rms(missing.tail<3>(), before.rotation_stddev_B, tracker.sigma_rotation);
}

}  // namespace

Result<InverseResult> CompensatedModel::nominal_joints(const Target& target,
                                                       const Pose& X_TF) const {
  const Chain& robot = cell().robot;
  if (target.joint_target) {
    if (!target.seed) return refused("a joint target without joints").of("joints");
    const bool outside = robot.joint_outside_limits(*target.seed).has_value();
    return InverseResult{outside ? InverseStatus::kJointLimit : InverseStatus::kOk, *target.seed,
                         0};
  }
  if (target.conf) return inverse_kinematics(robot, target.X_BT * X_TF, *target.conf, target.seed);
  if (target.seed && has_few_joints(robot))
    return inverse_kinematics_of_few(robot, target.X_BT, X_TF.inverse(), *target.seed);
  if (target.seed) return inverse_kinematics(robot, target.X_BT * X_TF, *target.seed);
  return refused("a target needs a branch (conf) or joints as a seed").of("conf");
}

CompensatedModel::Approach CompensatedModel::approach(const Pose& X_BT_wanted, PoseContext context,
                                                      const Pose& X_BT_predicted,
                                                      double bias_weight,
                                                      const CorrectOptions& options) const {
  const Pose X_TF = parts().physics.tools.at(context.tool).inverse();
  Approach now{X_BT_wanted,
               {InverseStatus::kOk, context.q, 0},
               pose_difference(X_BT_wanted, X_BT_predicted),
               0};
  const auto settled = [&] {
    return now.missing.head<3>().norm() < options.tolerance &&
           now.missing.tail<3>().norm() < kRotationTolerance;
  };
  // The learned bias hardly changes along a correction, and takes longer to compute than the
  // physics. So the steps reuse its last value, and it is computed again once the physics has
  // settled.
  context = completed(std::move(context));
  const Pose X_BT_calibrated = calibrated_pose_B(context);
  LearnedMotion learned{X_BT_predicted.translation() - X_BT_calibrated.translation(),
                        X_BT_predicted.linear() * X_BT_calibrated.linear().transpose()};
  const MissingAt missing_at = [&](const JointVector& q, bool anew) {
    context.q = q;
    if (anew) learned = learned_motion(context, bias_weight);
    return pose_difference(X_BT_wanted, moved(calibrated_pose_B(context), learned));
  };
  const Pose X_FT = X_TF.inverse();
  std::optional<CorrectedJoints> by_steps;
  if (const auto wrist = closing_wrist(cell().robot, context.q)) {
    by_steps =
        correct_in_wrist(cell().robot, X_FT, *wrist, context.q, now.missing, missing_at, options);
  } else if (has_few_joints(cell().robot)) {
    by_steps = correct_few_joints(cell().robot, X_FT, context.q, now.missing, missing_at, options);
  }
  if (by_steps) {
    now.X_BT_commanded = cell().robot.flange_pose(by_steps->q) * X_FT;
    now.joints.q = by_steps->q;
    if (cell().robot.joint_outside_limits(by_steps->q))
      now.joints.status = InverseStatus::kJointLimit;
    now.missing = by_steps->missing;
    now.iterations = by_steps->iterations;
    now.settled = by_steps->settled;
    return now;
  }
  while (!settled() && now.iterations < options.max_iterations) {
    ++now.iterations;
    now.X_BT_commanded.translation() += now.missing.head<3>();
    now.X_BT_commanded.linear() =
        (rotation_exp(now.missing.tail<3>()) * now.X_BT_commanded.linear()).eval();
    now.joints = inverse_kinematics(cell().robot, now.X_BT_commanded * X_TF, context.q);
    if (now.joints.status != InverseStatus::kOk) return now;
    context.q = now.joints.q;
    const Pose X_BT = calibrated_pose_B(context);
    now.missing = pose_difference(X_BT_wanted, moved(X_BT, learned));
    if (!settled() && now.iterations < options.max_iterations) continue;
    learned = learned_motion(context, bias_weight);
    now.missing = pose_difference(X_BT_wanted, moved(X_BT, learned));
  }
  now.settled = settled();
  return now;
}

std::vector<int> CompensatedModel::branches_that_reach(const Target& asked, const Pose& X_BT_wanted,
                                                       PoseContext context,
                                                       const CorrectOptions& options) const {
  std::vector<int> found;
  if (!has_spherical_wrist(cell().robot)) return found;
  const Pose X_BF = X_BT_wanted * parts().physics.tools.at(context.tool).inverse();
  for (int conf = 0; conf <= kHighestConf; ++conf) {
    if (asked.conf == conf) continue;
    const Result<InverseResult> joints = inverse_kinematics(cell().robot, X_BF, conf, asked.seed);
    if (!joints || joints->status != InverseStatus::kOk) continue;
    context.q = joints->q;
    if (approach(X_BT_wanted, context, pose_B(context, 1), 1, options).settled)
      found.push_back(conf);
  }
  return found;
}

Correction CompensatedModel::correct(const Target& target, const std::string& tool,
                                     const std::string& payload,
                                     const CorrectOptions& options) const {
  PoseContext context = way_to(target, tool, payload);
  const Pose& X_FT = parts().physics.tools.at(tool);
  Correction result;
  const auto end = [&](CorrectionStatus status, std::string message) {
    result.status = status;
    result.message = std::move(message);
    return result;
  };
  const auto not_reached = [&](const InverseResult& joints) {
    return end(
        status_of(joints.status),
        with_branch_hint(why_not(cell().robot, result.X_BT_wanted, X_FT, joints, target.conf),
                         branches_that_reach(target, result.X_BT_wanted, context, options)));
  };

  const Result<InverseResult> start = nominal_joints(target, X_FT.inverse());
  if (!start) return end(CorrectionStatus::kRefused, sentence(start.error()));
  come_as_said(cell().robot, start->q, context);
  result.X_BT_wanted =
      target.joint_target ? parts().physics.X_WB.inverse() * parts().physics.nominal_pose_W(context)
                          : target.X_BT;
  // Without a correction, the target pose is commanded.
  result.X_BT_commanded = result.X_BT_wanted;
  result.q = start->q;
  if (start->status == InverseStatus::kUnreachable) return not_reached(*start);

  const ErrorPrediction before = predict(context);
  expect_before(before, cell().tracker, result);
  const bool in_wrist = closing_wrist(cell().robot, start->q).has_value();
  const bool passes = in_wrist && start->status == InverseStatus::kSingular;
  if (start->status != InverseStatus::kOk && !passes) return not_reached(*start);

  // The weight of the target is used: a correction moves too little to change it.
  const double bias_weight = before.bias_weight;
  const Approach found =
      approach(result.X_BT_wanted, context, before.X_BT_predicted, bias_weight, options);
  result.iterations = found.iterations;
  result.left = found.missing.head<3>().norm();
  if (found.joints.status != InverseStatus::kOk) return not_reached(found.joints);
  if (!found.settled) {
    return end(CorrectionStatus::kNotConverged, fmt::format("{:.2e} mm left after {} iterations",
                                                            to_mm(result.left), result.iterations));
  }
  if (!in_wrist && changes_configuration(cell().robot, start->q, found.joints.q))
    return end(CorrectionStatus::kSingular,
               "corrected, the arm would come to another configuration");
  result.X_BT_commanded = found.X_BT_commanded;
  result.q = found.joints.q;
  expect_after(before, found.missing, cell().tracker, result);
  std::string said = below_resolution(*this, context, before);
  if (in_wrist || has_few_joints(cell().robot))
    said = both_said(std::move(said), turn_left(cell().robot, found.missing.tail<3>()));
  if (before.in_domain) return end(CorrectionStatus::kOk, said);
  return end(CorrectionStatus::kOutOfDomain,
             both_said(corrected_by(inside_->bias, bias_weight), said));
}

}  // namespace trammel
