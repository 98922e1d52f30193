#include <cmath>

#include "server/compensate/compensated_model.h"
#include "server/compensate/domain.h"

namespace trammel {

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
  return predict(context, std::nullopt);
}

ErrorPrediction CompensatedModel::predict(const PoseContext& asked, std::optional<double> bias_weight) const {
  const std::optional<BiasModel>& bias = inside_->bias;
  if (!bias) return predict(asked, nullptr, bias_weight);
  const BiasPrediction learned =
      bias->needs_features() ? bias->predict(asked.q, features(completed(asked))) : bias->predict(asked.q);
  return predict(asked, &learned, bias_weight);
}

std::vector<ErrorPrediction> CompensatedModel::predict_all(const std::vector<PoseContext>& poses) const {
  const std::optional<BiasModel>& bias = inside_->bias;
  std::vector<BiasPrediction> learned;
  if (bias) {
    Eigen::MatrixXd q(static_cast<Eigen::Index>(poses.size()), cell().robot.size());
    std::vector<BiasFeatures> features_of_poses;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      q.row(static_cast<Eigen::Index>(i)) = poses[i].q.transpose();
      if (bias->needs_features()) features_of_poses.push_back(features(completed(poses[i])));
    }
    learned = bias->predict_all(q, features_of_poses);
  }
  std::vector<ErrorPrediction> predictions;
  for (std::size_t i = 0; i < poses.size(); ++i)
    predictions.push_back(predict(poses[i], bias ? &learned[i] : nullptr, std::nullopt));
  return predictions;
}

Pose CompensatedModel::pose_B(const PoseContext& asked, double bias_weight) const {
  const PoseContext context = completed(asked);
  const std::optional<BiasModel>& bias = inside_->bias;
  Pose X_BT = parts().physics.X_WB.inverse() * parts().physics.pose_W(context);
  if (!bias || bias_weight == 0) return X_BT;
  X_BT.translation() +=
      bias_weight * (bias->needs_features() ? bias->mean_B(context.q, features(context)) : bias->mean_B(context.q));
  return X_BT;
}

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

ErrorPrediction CompensatedModel::predict(const PoseContext& asked, const BiasPrediction* bias,
                                          std::optional<double> bias_weight) const {
  const PoseContext context = completed(asked);
  const PhysicalModel& physics = parts().physics;
  const Pose X_BW = physics.X_WB.inverse();
  Eigen::MatrixXd J_W;
  ErrorPrediction prediction;
  prediction.X_BT_nominal = X_BW * physics.nominal_pose_W(context);
  prediction.X_BT_predicted = X_BW * physics.pose_W(context, physics.values, &J_W);
  const Eigen::MatrixXd J_B = X_BW.linear() * J_W.topRows<3>();
  const Matrix3 identified = J_B * parts().covariance * J_B.transpose();
  const Matrix3 unsaid = covariance_of_unsaid(context, !asked.temperature, prediction.X_BT_predicted.translation());

  const Domain domain{parts().q_min, parts().q_max, parts().prior_share_limit};
  const bool trained_with = parts().trained_with.contains({context.tool, context.payload});
  prediction.in_domain = trained_with && domain.in_range(context.q);
  const double metrology = cell().tracker.sigma * cell().tracker.sigma;
  const double unlearned = metrology + parts().discrepancy * parts().discrepancy +
                           domain.growth(context.q, parts().extrapolation_slope, cell().robot);
  Matrix3 covariance = identified + unsaid;
  if (bias == nullptr) {
    covariance.diagonal().array() += unlearned;
  } else {
    prediction.in_domain &= bias->prior_share <= parts().prior_share_limit;
    const double weight = bias_weight.value_or(trained_with ? domain.bias_weight(context.q, bias->prior_share) : 0.0);
    prediction.bias_weight = weight;
    prediction.X_BT_predicted.translation() += weight * bias->mean_B;
    // Noise is never less than the tracker's: a fit to few poses takes some of it for signal. What the parameters
    // leave uncertain is part of a bias that has them; any other corrects it as far as it knows anything; where the
    // bias does not count it counts in full. What of the bias is not taken may be missing: as much as it is there, and
    // as it was at the training poses.
    const Vector3 known = bias->stddev_B.cwiseAbs2();
    const Vector3 noise = (bias->measured_stddev_B.cwiseAbs2() - known).cwiseMax(metrology);
    const Vector3 untaken = bias->mean_B.cwiseAbs2().cwiseMax(inside_->bias_size_B.cwiseAbs2());
    const double left_of_identified = inside_->bias_has_parameters ? 0.0 : bias->prior_share;
    covariance = bias->covariance_B + (weight * left_of_identified + (1 - weight)) * identified + unsaid;
    covariance.diagonal() +=
        weight * noise + (1 - weight) * noise.cwiseMax(unlearned) + (1 - weight) * (1 - weight) * untaken;
  }
  prediction.covariance_B = covariance;
  prediction.stddev_B = covariance.diagonal().cwiseSqrt();
  prediction.true_stddev_B = (covariance.diagonal().array() - metrology).max(0.0).sqrt();
  prediction.error_B = prediction.X_BT_predicted.translation() - prediction.X_BT_nominal.translation();
  return prediction;
}

}  // namespace trammel
