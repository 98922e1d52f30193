#include <cmath>

#include "server/compensate/arm_steps.h"
#include "server/compensate/compensated_model.h"
#include "server/compensate/domain.h"

namespace trammel {

namespace {

/// The prediction turned by R; the noise of the axes stays independent.
BiasPrediction turned_by(const Matrix3& R, const BiasPrediction& bias) {
  const Vector3 noise = bias.measured_stddev_B.cwiseAbs2() - bias.stddev_B.cwiseAbs2();
  BiasPrediction now = bias;
  now.mean_B = R * bias.mean_B;
  now.nearby_B = R * bias.nearby_B;
  now.covariance_B = R * bias.covariance_B * R.transpose();
  now.stddev_B = now.covariance_B.diagonal().cwiseSqrt();
  now.measured_stddev_B = (now.covariance_B.diagonal() + R.cwiseAbs2() * noise).cwiseSqrt();
  return now;
}

/// Sets the prior shares to those of the arm as it was when learned: a tool that has moved since
/// does not make a pose unknown. The covariance contains the motion of the tool's point.
void share_as_learned(const BiasModel& bias, const BiasPhysics& then,
                      const std::vector<PoseContext>& poses, const Eigen::MatrixXd& q,
                      const std::vector<BiasFeatures>& now,
                      std::vector<BiasPrediction>& predictions) {
  std::vector<BiasFeatures> as_learned;
  bool moved = false;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    as_learned.push_back(then.at(poses[i]));
    moved = moved || as_learned.back().by_parameter != now[i].by_parameter ||
            as_learned.back().lever_F != now[i].lever_F;
  }
  if (!moved) return;
  const std::vector<BiasPrediction> known = bias.predict_all(q, as_learned);
  for (std::size_t i = 0; i < poses.size(); ++i) predictions[i].prior_share = known[i].prior_share;
}

}  // namespace

PoseContext CompensatedModel::completed(PoseContext asked) const {
  if (!asked.temperature) asked.temperature = parts().temperature_mean;
  return asked;
}

ErrorPrediction CompensatedModel::predict(const JointVector& q, const std::string& tool,
                                          const std::string& payload) const {
  PoseContext context;
  context.q = q;
  context.tool = tool;
  context.payload = payload;
  context.served = true;
  return predict(context);
}

ErrorPrediction CompensatedModel::predict(const PoseContext& asked) const {
  if (!inside_->bias) return predict(asked, nullptr);
  return predict(asked, &learned({asked}).front());
}

std::vector<CompensatedModel::Learned> CompensatedModel::turn(std::vector<Learned> all) const {
  if (!inside_->bias_turn) return all;
  for (Learned& one : all) {
    one.position = turned_by(*inside_->bias_turn, one.position);
    if (one.rotation) one.rotation = turned_by(*inside_->bias_turn, *one.rotation);
  }
  return all;
}

std::vector<CompensatedModel::Learned> CompensatedModel::learned(
    const std::vector<PoseContext>& poses) const {
  const BiasModel& bias = *inside_->bias;
  Eigen::MatrixXd q(static_cast<Eigen::Index>(poses.size()), cell().robot.size());
  std::vector<PoseContext> contexts;
  std::vector<BiasFeatures> of_position, of_rotation;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    q.row(static_cast<Eigen::Index>(i)) = poses[i].q.transpose();
    if (!bias.needs_features()) continue;
    contexts.push_back(completed(poses[i]));
    of_position.push_back(features(contexts.back()));
    if (inside_->rotation_bias) of_rotation.push_back(turned(of_position.back()));
  }
  std::vector<BiasPrediction> positions = bias.predict_all(q, of_position);
  if (parts().bias_origin && bias.needs_features())
    share_as_learned(bias, learned_physics(), contexts, q, of_position, positions);
  std::vector<Learned> all;
  for (BiasPrediction& position : positions) all.push_back({std::move(position), std::nullopt});
  if (!inside_->rotation_bias) return turn(std::move(all));
  std::vector<BiasPrediction> rotations = inside_->rotation_bias->predict_all(q, of_rotation);
  for (std::size_t i = 0; i < all.size(); ++i) all[i].rotation = std::move(rotations[i]);
  return turn(std::move(all));
}

std::vector<ErrorPrediction> CompensatedModel::predict_all(
    const std::vector<PoseContext>& poses) const {
  std::vector<Learned> all;
  if (inside_->bias) all = learned(poses);
  std::vector<ErrorPrediction> predictions;
  for (std::size_t i = 0; i < poses.size(); ++i)
    predictions.push_back(predict(poses[i], all.empty() ? nullptr : &all[i]));
  return predictions;
}

namespace {

/// The part of a bias that is taken: its kernel fades with `weight`, its blocks do not.
Vector3 taken(const Vector3& mean_B, const Vector3& nearby_B, double weight) {
  return (mean_B - nearby_B) + weight * nearby_B;
}

Vector3 taken(const BiasModel& bias, const JointVector& q, const BiasFeatures& features,
              double weight) {
  const Vector3 mean_B = bias.mean_B(q, features);
  if (!bias.has_blocks()) return weight * mean_B;
  return weight == 1 ? mean_B : taken(mean_B, bias.nearby_mean_all_B(q.transpose()).row(0), weight);
}

}  // namespace

CompensatedModel::LearnedMotion CompensatedModel::learned_motion(const PoseContext& context,
                                                                 double bias_weight) const {
  LearnedMotion motion;
  if (!inside_->bias) return motion;
  const std::optional<BiasModel>& rotation = inside_->rotation_bias;
  const BiasFeatures of_position =
      inside_->bias->needs_features() ? features(context) : BiasFeatures{};
  const Matrix3 turn = inside_->bias_turn.value_or(Matrix3::Identity());
  motion.shift = turn * taken(*inside_->bias, context.q, of_position, bias_weight);
  if (!rotation) return motion;
  const BiasFeatures of_rotation = rotation->needs_features() ? turned(of_position) : of_position;
  motion.turn = rotation_exp(turn * taken(*rotation, context.q, of_rotation, bias_weight));
  return motion;
}

Pose CompensatedModel::calibrated_pose_B(const PoseContext& context) const {
  return parts().physics.X_WB.inverse() * parts().physics.pose_W(context);
}

Pose CompensatedModel::moved(const Pose& X_BT, const LearnedMotion& by) {
  Pose moved = X_BT;
  moved.translation() += by.shift;
  moved.linear() = by.turn * X_BT.linear();
  return moved;
}

Pose CompensatedModel::pose_B(const PoseContext& asked, double bias_weight) const {
  const PoseContext context = completed(asked);
  return moved(calibrated_pose_B(context), learned_motion(context, bias_weight));
}

namespace {

/// True if the side from which the joint came is known. A request may state the sides of only some
/// joints.
bool says_where_from(const PoseContext& context, int joint) {
  if (!context.before) return false;
  return context.direction.empty() || context.direction[static_cast<std::size_t>(joint)] != 0;
}

/// The context after a long move of that joint.
PoseContext come_from_afar(PoseContext context, int joint) {
  context.before = context.q;
  (*context.before)(joint) -= 1;
  return context;
}

}  // namespace

Matrix3 CompensatedModel::covariance_of_unsaid(const PoseContext& context, bool temperature_unsaid,
                                               const Vector3& p_B) const {
  const PhysicalModel& physics = parts().physics;
  const Pose X_BW = physics.X_WB.inverse();
  Matrix3 covariance = Matrix3::Zero();
  const auto add = [&](const PoseContext& other) {
    const Vector3 moved_B = X_BW * physics.pose_W(other).translation() - p_B;
    covariance += moved_B * moved_B.transpose();
  };
  bool warm = false;
  for (const ErrorSourcePtr& source : physics.sources) {
    const ContextNeeds needs = source->needs();
    warm = warm || needs.temperature;
    if (needs.before && source->joint() >= 0 && !says_where_from(context, source->joint()))
      add(come_from_afar(context, source->joint()));
    if (!needs.direction || !context.direction.empty()) continue;
    PoseContext approached = context;
    approached.direction.assign(static_cast<std::size_t>(context.q.size()), 0);
    approached.direction[static_cast<std::size_t>(source->joint())] = 1;
    add(approached);
  }
  if (warm && temperature_unsaid && context.temperature) {
    PoseContext warmer = context;
    *warmer.temperature += parts().temperature_stddev;
    add(warmer);
  }
  return covariance;
}

namespace {

/// The uncertainty of a pose apart from its bias: of the position, m and m², or of the rotation,
/// rad and rad².
struct Uncertainty {
  Matrix3 identified;  ///< covariance that the parameters leave
  Matrix3 since;       ///< the part of it that was identified after the bias was learned
  double metrology;    ///< variance of one axis: the instrument's
  double unlearned;    ///< variance of one axis without a bias: the residual of the physics
  double growth;      ///< variance of one axis that grows with the distance from the training poses
  Vector3 bias_size;  ///< rms of the bias over the training poses, where no slope was learned
};

/// Covariance of one measurement.
/// - Noise is never less than the instrument's: a fit to few poses takes some of the noise for
///   signal.
/// - Covariance of the parameters: a bias with blocks of parameters (`has_parameters`) contains it.
///   Any other bias corrects it to the extent that the bias is applied and knows the pose; the rest
///   counts in full.
/// - No bias corrects parameters that were identified after it was learned.
/// - The part of the bias that is not applied may be missing. It is as large as the bias at that
///   pose, or as it was at the training poses.
/// - The bias' own covariance stays: far from its poses a kernel has its prior, and blocks have
///   what the data left them.
Matrix3 with_bias(const BiasPrediction& bias, double weight, bool has_parameters,
                  const Uncertainty& of) {
  const Vector3 known = bias.stddev_B.cwiseAbs2();
  const Vector3 noise = (bias.measured_stddev_B.cwiseAbs2() - known).cwiseMax(of.metrology);
  const Vector3 untaken = bias.nearby_B.cwiseAbs2().cwiseMax(of.bias_size.cwiseAbs2());
  const double left_of_identified = has_parameters ? 0 : weight * bias.prior_share + (1 - weight);
  Matrix3 covariance =
      bias.covariance_B + left_of_identified * of.identified + (1 - left_of_identified) * of.since;
  covariance.diagonal() += weight * noise + (1 - weight) * noise.cwiseMax(of.unlearned) +
                           (1 - weight) * (1 - weight) * untaken +
                           Vector3::Constant((1 - weight) * of.growth);
  return covariance;
}

}  // namespace

Matrix3 CompensatedModel::identified(const Eigen::MatrixXd& J_B) const {
  return J_B * parts().covariance * J_B.transpose();
}

Matrix3 CompensatedModel::identified_since(const Eigen::MatrixXd& J_B) const {
  if (!parts().bias_origin) return Matrix3::Zero();
  return J_B * parts().bias_origin->covariance * J_B.transpose();
}

double CompensatedModel::unlearned(const CalibratedPose& pose) const {
  const double metrology = cell().tracker.sigma * cell().tracker.sigma;
  return metrology + parts().discrepancy * parts().discrepancy + pose.growth;
}

Matrix3 CompensatedModel::spread(const Matrix3& covariance, double bias_weight) const {
  if (parts().bias_spread == 1) return covariance;
  const Matrix3 instrument = std::pow(cell().tracker.sigma, 2) * Matrix3::Identity();
  const double square = 1 + bias_weight * (std::pow(parts().bias_spread, 2) - 1);
  return instrument + square * (covariance - instrument);
}

Matrix3 CompensatedModel::add_position_bias(const CalibratedPose& pose, const BiasPrediction& bias,
                                            ErrorPrediction* prediction) const {
  const double weight = prediction->bias_weight;
  prediction->X_BT_predicted.translation() += taken(bias.mean_B, bias.nearby_B, weight);
  const Eigen::MatrixXd J_B = pose.X_BW.linear() * pose.J_W.topRows<3>();
  Uncertainty of{.identified = identified(J_B),
                 .since = identified_since(J_B),
                 .metrology = cell().tracker.sigma * cell().tracker.sigma,
                 .unlearned = unlearned(pose),
                 .growth = 0,
                 .bias_size = inside_->bias_size_B};
  if (inside_->bias->has_blocks()) {
    // With blocks, the slope describes errors beyond the bias' own covariance; otherwise errors of
    // the physics.
    of.unlearned = of.metrology;
    of.growth = pose.growth;
  }
  return with_bias(bias, weight, inside_->bias_has_parameters, of);
}

// Training learns no slope for rotations. Far outside, a map may therefore be wrong by the whole
// learned effect.
void CompensatedModel::add_rotation_bias(const CalibratedPose& pose, const BiasPrediction& bias,
                                         ErrorPrediction* prediction) const {
  const double weight = prediction->bias_weight;
  const Eigen::MatrixXd J_B = pose.X_BW.linear() * pose.J_W.bottomRows<3>();
  const double instrument = cell().tracker.sigma_rotation * cell().tracker.sigma_rotation;
  prediction->X_BT_predicted.linear() = (rotation_exp(taken(bias.mean_B, bias.nearby_B, weight)) *
                                         prediction->X_BT_predicted.linear())
                                            .eval();
  const Uncertainty of{.identified = identified(J_B),
                       .since = identified_since(J_B),
                       .metrology = instrument,
                       .unlearned = instrument,
                       .growth = 0,
                       .bias_size = inside_->rotation_bias_size_B};
  prediction->rotation_stddev_B =
      with_bias(bias, weight, inside_->bias_has_parameters, of).diagonal().cwiseSqrt();
}

namespace {

/// Raises the covariance of one measurement until its true part has at least this rms. The addition
/// is the same along each axis.
void raise_to(double least_rms, double metrology, Matrix3& covariance) {
  const Vector3 known = (covariance.diagonal().array() - metrology).max(0.0);
  const double missing = least_rms * least_rms - known.sum();
  if (missing > 0) covariance.diagonal() = known.array() + metrology + missing / 3;
}

}  // namespace

ErrorPrediction CompensatedModel::predict(const PoseContext& asked, const Learned* learned) const {
  const PhysicalModel& physics = parts().physics;
  CalibratedPose pose{completed(asked), physics.X_WB.inverse(), {}, 0};
  const PoseContext& context = pose.context;
  ErrorPrediction prediction;
  prediction.X_BT_nominal = pose.X_BW * physics.nominal_pose_W(context);
  prediction.X_BT_predicted = pose.X_BW * physics.pose_W(context, physics.values, &pose.J_W);
  const Matrix3 unsaid =
      covariance_of_unsaid(context, !asked.temperature, prediction.X_BT_predicted.translation());
  Domain domain{parts().q_min, parts().q_max, parts().prior_share_limit};
  const bool trained_with = learned_with(context.tool, context.payload);
  const std::optional<WhatWasMeasured>& measured = parts().measured;
  if (measured) domain.margin = measured->range_margin();
  prediction.in_domain = trained_with && domain.in_range(context.q) &&
                         (!measured || (measured->is_near(cell().robot, context.q) &&
                                        measured->is_side_measured(context)));
  pose.growth = domain.growth(context.q, parts().extrapolation_slope, cell().robot);

  Matrix3 covariance;
  if (learned == nullptr) {
    covariance = identified(pose.X_BW.linear() * pose.J_W.topRows<3>()) + unsaid;
    covariance.diagonal().array() += unlearned(pose);
  } else {
    const double share = learned->position.prior_share;
    prediction.in_domain &= share <= parts().prior_share_limit;
    prediction.bias_weight = trained_with ? domain.bias_weight(context.q, share) : 0.0;
    covariance =
        spread(add_position_bias(pose, learned->position, &prediction), prediction.bias_weight) +
        unsaid;
    if (inside_->bias_has_parameters && prediction.bias_weight < 1) {
      // Near its poses the bias has learned this; part of it went into the weights, so its
      // direction is not known.
      const Vector3 left_B =
          inside_->bias_physics.beyond_first_order(context, inside_->bias->parameter_weights());
      covariance.diagonal().array() += (1 - prediction.bias_weight) * left_B.squaredNorm();
    }
    if (learned->rotation) add_rotation_bias(pose, *learned->rotation, &prediction);
  }
  const double metrology = cell().tracker.sigma * cell().tracker.sigma;
  raise_to(least_rms(*this, context), metrology, covariance);
  prediction.covariance_B = covariance;
  prediction.stddev_B = covariance.diagonal().cwiseSqrt();
  prediction.true_stddev_B = (covariance.diagonal().array() - metrology).max(0.0).sqrt();
  prediction.error_B =
      prediction.X_BT_predicted.translation() - prediction.X_BT_nominal.translation();
  return prediction;
}

}  // namespace trammel
