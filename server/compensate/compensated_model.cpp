#include "server/compensate/compensated_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/check.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/compensate/file/write_parts.h"
#include "server/measurement/gauges.h"

namespace trammel {

namespace {

constexpr std::size_t kIdLength =
    12;  // of a model, in digits of its hash: enough to distinguish every model of a plant

Vector3 column_rms(const Eigen::MatrixXd& rows) {
  return (rows.colwise().squaredNorm() / static_cast<double>(rows.rows())).cwiseSqrt();
}

/// Checks the history of the pose.
Status check_history(const PoseContext& context, Eigen::Index joints, std::size_t row) {
  if (context.before && context.before->size() != joints)
    return refused("model: pose {} of the bias came from {} joints, not {}", row,
                   context.before->size(), joints)
        .of("before")
        .beyond(context.before->size(), joints);
  if (context.before && !context.before->allFinite())
    return refused("model: pose {} of the bias came from joints that are not finite", row)
        .of("before");
  if (!context.lagged.empty() && context.lagged.size() != kHeatLags.size())
    return refused("model: pose {} of the bias has {} lagged temperatures, not {}", row,
                   context.lagged.size(), kHeatLags.size())
        .of("lagged_c")
        .beyond(context.lagged.size(), kHeatLags.size());
  if (!std::all_of(context.lagged.begin(), context.lagged.end(),
                   [](double t) { return std::isfinite(t); }))
    return refused("model: pose {} of the bias has a lagged temperature that is not finite", row)
        .of("lagged_c");
  return {};
}

/// Checks an observation of the bias of its pose, for `joints` joints; `row` counts from 1.
Status check_context(const PoseContext& context, Eigen::Index joints, std::size_t row) {
  const auto not_finite = [](const std::optional<double>& value) {
    return value && !std::isfinite(*value);
  };
  const std::vector<int>& directions = context.direction;
  if (!directions.empty() && static_cast<Eigen::Index>(directions.size()) != joints)
    return refused("model: pose {} of the bias has {} directions for {} joints", row,
                   directions.size(), joints)
        .of("direction")
        .beyond(directions.size(), joints);
  for (const int direction : directions) {
    if (direction < -1 || direction > 1)
      return refused("model: pose {} of the bias has a direction {}, expected -1, 0 or 1", row,
                     direction)
          .of("direction")
          .beyond(direction, direction < 0 ? -1 : 1);
  }
  if (context.velocity && context.velocity->size() != joints)
    return refused("model: pose {} of the bias has {} velocities for {} joints", row,
                   context.velocity->size(), joints)
        .of("velocity")
        .beyond(context.velocity->size(), joints);
  if (context.velocity && !context.velocity->allFinite())
    return refused("model: pose {} of the bias has a velocity that is not finite", row)
        .of("velocity");
  TRY(check_history(context, joints, row));
  if (not_finite(context.time))
    return refused("model: pose {} of the bias has a time that is not finite", row).of("time");
  if (not_finite(context.temperature))
    return refused("model: pose {} of the bias has a temperature that is not finite", row)
        .of("temperature");
  if (context.index < 0)
    return refused("model: pose {} of the bias has the index {}", row, context.index)
        .of("index")
        .beyond(context.index, 0);
  return {};
}

/// At the observations of a bias with blocks or at the flange.
Result<std::vector<BiasFeatures>> features_of(const ModelParts& parts, const BiasPhysics& physics) {
  const BiasState& bias = *parts.bias;
  if (static_cast<Eigen::Index>(parts.bias_contexts.size()) != bias.q.rows()) {
    return refused("model: {} poses are described for {} observations of the bias",
                   parts.bias_contexts.size(), bias.q.rows())
        .of("bias")
        .beyond(parts.bias_contexts.size(), bias.q.rows());
  }
  std::vector<BiasFeatures> features;
  for (std::size_t i = 0; i < parts.bias_contexts.size(); ++i) {
    PoseContext context = parts.bias_contexts[i];
    TRY(check_context(context, bias.q.cols(), i + 1));
    context.q = bias.q.row(static_cast<Eigen::Index>(i)).transpose();
    const bool known_payload =
        context.payload.empty() || parts.physics.cell->payloads.contains(context.payload);
    if (!parts.physics.tools.contains(context.tool) || !known_payload) {
      return refused(
                 "model: the bias learned at tool '{}' and payload '{}', which its cell does not "
                 "have",
                 context.tool, context.payload)
          .of("bias")
          .with_text(context.tool + " " + context.payload);
    }
    features.push_back(physics.at(context));
  }
  return features;
}

BiasPhysics physics_of_bias(const ModelParts& parts) {
  return parts.bias_origin ? BiasPhysics::learned_at(parts.bias_origin->physics)
                           : BiasPhysics(parts.physics);
}

Status check_origin(const ModelParts& parts) {
  if (!parts.bias_origin) return {};
  const ModelParts::BiasOrigin& origin = *parts.bias_origin;
  const auto P = parts.covariance.rows();
  if (origin.covariance.rows() != P || origin.covariance.cols() != P ||
      !origin.covariance.allFinite() ||
      origin.physics.values.size() != origin.physics.parameter_count() ||
      !origin.physics.values.allFinite()) {
    return refused("model: where its bias was learned does not fit its {} parameters", P);
  }
  return {};
}

/// Checks that the parts are of one robot.
Status check_fit(const ModelParts& parts) {
  const int n = parts.physics.cell->robot.size();
  const auto P = static_cast<Eigen::Index>(parts.physics.parameter_count());
  if (parts.q_min.size() != n || parts.q_max.size() != n || parts.physics.values.size() != P ||
      parts.covariance.rows() != P || parts.covariance.cols() != P) {
    return refused(
        "model: {} parameters and {} joint ranges do not fit a robot of {} joints with {} "
        "parameters",
        parts.physics.values.size(), parts.q_min.size(), n, P);
  }
  if (parts.extrapolation_slope.size() != 0 && parts.extrapolation_slope.size() != n) {
    return refused("model: {} extrapolation slopes for {} joints", parts.extrapolation_slope.size(),
                   n);
  }
  if (!parts.physics.values.allFinite() || !parts.covariance.allFinite()) {
    return refused("model: a parameter is not finite").of("parameters");
  }
  if (!std::isfinite(parts.bias_spread) || parts.bias_spread < 1)
    return refused("model: a bias_spread of {}, at least 1 is expected", parts.bias_spread)
        .of("bias_spread");
  TRY(check_origin(parts));
  if (parts.bias && parts.bias->q.cols() != n)
    return refused("model: the bias knows {} joints, the robot {}", parts.bias->q.cols(), n);
  return {};
}

/// The bias of the orientation, with the same features and contexts as that of the position,
/// `of_position`.
Result<BiasModel> restored_rotation(BiasState rotation, const BiasState& of_position) {
  if (rotation.kernel != without_flange(of_position.kernel) || rotation.q != of_position.q)
    return refused(
        "model: the bias of the orientation is not of the same poses and kernel as that of the "
        "position");
  for (const BiasFeatures& features : of_position.features)
    rotation.features.push_back(turned(features));
  return BiasModel::restore(rotation);
}

}  // namespace

Status CompensatedModel::restore_biases(const Parts& parts, const BiasPhysics& then,
                                        Inside* inside) {
  BiasState state = *parts.bias;
  const Result<SpelledBias> spelled = spelled_bias(state.kernel);
  if (spelled && spelled->needs_features()) {
    std::vector<BiasFeatures> features = TRY(features_of(parts, then));
    state.features = std::move(features);
    inside->bias_has_parameters = spelled->has("parameters");
  }
  if (parts.bias_origin) inside->bias_turn = then.turn_to(parts.physics);
  const auto turned_rms = [&](const Eigen::MatrixXd& residual_B) {
    return column_rms(inside->bias_turn ? residual_B * inside->bias_turn->transpose() : residual_B);
  };
  BiasModel bias = TRY(BiasModel::restore(state));
  inside->bias = std::move(bias);
  if (!inside->bias->has_blocks()) inside->bias_size_B = turned_rms(state.residual_B);
  if (!parts.rotation_bias) return {};
  BiasModel rotation = TRY(restored_rotation(*parts.rotation_bias, state));
  if (!inside->bias_has_parameters)
    inside->rotation_bias_size_B = turned_rms(parts.rotation_bias->residual_B);
  inside->rotation_bias = std::move(rotation);
  return {};
}

Result<CompensatedModel> CompensatedModel::make(Parts parts) {
  TRY(check_fit(parts));
  const BiasPhysics then = physics_of_bias(parts);
  auto inside =
      std::make_shared<Inside>(parts.bias_origin ? then.with_tools_of(parts.physics) : then);
  if (parts.bias) {
    TRY(restore_biases(parts, then, inside.get()));
  }
  parts.provenance.hash = model_file::content_hash(parts);
  parts.provenance.id = parts.provenance.hash.substr(0, kIdLength);
  inside->parts = std::move(parts);
  return CompensatedModel(std::move(inside));
}

BiasPhysics CompensatedModel::learned_physics() const { return physics_of_bias(parts()); }

bool CompensatedModel::learned_with(const std::string& tool, const std::string& payload) const {
  if (parts().trained_with.contains({tool, payload})) return true;
  if (!inside_->bias || !inside_->bias->needs_features() || inside_->bias->has_blocks())
    return false;
  const auto known = cell().tools.find(tool);
  if (known == cell().tools.end() || !known->second) return false;
  return std::any_of(parts().trained_with.begin(), parts().trained_with.end(),
                     [&](const auto& trained) { return trained.second == payload; });
}

Status CompensatedModel::check_trained_with(const std::string& tool,
                                            const std::string& payload) const {
  if (learned_with(tool, payload)) return {};
  std::string known;
  for (const auto& [one, load] : parts().trained_with) {
    known += fmt::format("{}'{}' and '{}'", known.empty() ? "" : ", ", one, load);
  }
  return refused(
             "model {} of cell {}: was not trained with tool '{}' and payload '{}', only with {}",
             provenance().id, cell().name, tool, payload, known)
      .of("tool_id")
      .with_text(tool);
}

bool CompensatedModel::is_own(const MeasurementBatch& batch) const {
  return batch.as_then || batch_hash(batch) == parts().provenance.batch_hash;
}

void CompensatedModel::add_rotations(const MeasurementBatch& batch,
                                     const std::vector<PoseContext>& poses,
                                     const std::vector<ErrorPrediction>& predictions,
                                     LevelErrors* errors) const {
  const PhysicalModel& physics = parts().physics;
  const Pose X_BW = physics.X_WB.inverse();
  std::vector<std::size_t> oriented;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (batch.measurements[i].R_WT) oriented.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(oriented.size());
  LevelErrors::Rotations& rotation = errors->rotation;
  rotation.nominal.resize(3, n);
  rotation.calibrated.resize(3, n);
  rotation.compensated.resize(3, n);
  rotation.stddev.resize(3, inside_->rotation_bias ? n : 0);
  for (Eigen::Index k = 0; k < n; ++k) {
    const std::size_t i = oriented[static_cast<std::size_t>(k)];
    const Matrix3 R_BT = X_BW.linear() * *batch.measurements[i].R_WT;
    const auto error_of = [&](const Pose& X_BT) {
      return rotation_log(R_BT * X_BT.linear().transpose());
    };
    rotation.nominal.col(k) = error_of(predictions[i].X_BT_nominal);
    rotation.calibrated.col(k) = error_of(X_BW * physics.pose_W(completed(poses[i])));
    rotation.compensated.col(k) = error_of(predictions[i].X_BT_predicted);
    if (predictions[i].rotation_stddev_B)
      rotation.stddev.col(k) = *predictions[i].rotation_stddev_B;
  }
}

CompensatedModel::LevelErrors CompensatedModel::errors_B(const MeasurementBatch& batch) const {
  TRAMMEL_CHECK(!has_gauges(batch));
  const PhysicalModel& physics = parts().physics;
  const Pose X_BW = physics.X_WB.inverse();
  const auto n = static_cast<Eigen::Index>(batch.measurements.size());
  LevelErrors errors{Eigen::Matrix3Xd(3, n),
                     Eigen::Matrix3Xd(3, n),
                     Eigen::Matrix3Xd(3, n),
                     Eigen::Matrix3Xd(3, n),
                     {}};
  const bool own = is_own(batch);
  std::vector<PoseContext> poses;
  for (const Measurement& m : batch.measurements) {
    poses.push_back(m.context);
    poses.back().served = !own;
  }
  const std::vector<ErrorPrediction> predictions = predict_all(poses);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto pose = static_cast<std::size_t>(i);
    const Vector3 p_B = X_BW * batch.measurements[pose].p_W;
    const ErrorPrediction& prediction = predictions[pose];
    errors.nominal.col(i) = p_B - prediction.X_BT_nominal.translation();
    errors.calibrated.col(i) = p_B - X_BW * physics.pose_W(completed(poses[pose])).translation();
    errors.compensated.col(i) = p_B - prediction.X_BT_predicted.translation();
    errors.stddev.col(i) = prediction.stddev_B;
    errors.in_domain.push_back(prediction.in_domain);
  }
  add_rotations(batch, poses, predictions, &errors);
  return errors;
}

namespace {

/// m, the stated sigma of each row.
Eigen::VectorXd stated_sigmas(const MeasurementBatch& batch, const Cell& cell) {
  Eigen::VectorXd sigmas(std::ssize(batch.measurements));
  for (Eigen::Index i = 0; i < sigmas.size(); ++i)
    sigmas(i) = batch.measurements[static_cast<std::size_t>(i)].sigma.value_or(cell.tracker.sigma);
  return sigmas;
}

/// `stated`: the stated sigmas of the rows of the errors.
GaugeFigures figures_of(const CompensatedModel::GaugeErrors& errors,
                        const Eigen::VectorXd& stated) {
  const auto rms = [](const Eigen::VectorXd& e) {
    return std::sqrt(e.squaredNorm() / static_cast<double>(e.size()));
  };
  return {static_cast<int>(errors.rows.size()),
          rms(errors.nominal),
          rms(errors.calibrated),
          rms(errors.compensated),
          errors.compensated.cwiseAbs().maxCoeff(),
          coverage_95(errors.compensated.transpose(), errors.stddev.transpose()),
          static_cast<int>(std::count(errors.in_domain.begin(), errors.in_domain.end(), true)),
          coverage_95(errors.compensated.transpose(), stated.transpose())};
}

}  // namespace

Evaluation CompensatedModel::evaluate(const MeasurementBatch& batch) const {
  if (!has_gauges(batch)) return evaluate_positions(batch);
  const MeasurementBatch positions = positions_of(batch);
  Evaluation evaluation;
  evaluation.nominal = evaluation.calibrated = evaluation.compensated = no_figures();
  evaluation.coverage_95 = std::numeric_limits<double>::quiet_NaN();
  if (!positions.measurements.empty()) evaluation = evaluate_positions(positions);
  const GaugeErrors errors = gauge_errors(batch);
  evaluation.gauges = figures_of(errors, stated_sigmas(batch, cell())(errors.rows));
  return evaluation;
}

Evaluation CompensatedModel::evaluate_positions(const MeasurementBatch& batch) const {
  const LevelErrors errors = errors_B(batch);
  Evaluation evaluation;
  evaluation.poses = static_cast<int>(batch.measurements.size());
  evaluation.nominal = figures_of(errors.nominal);
  evaluation.calibrated = figures_of(errors.calibrated);
  evaluation.compensated = figures_of(errors.compensated);
  evaluation.coverage_95 = coverage_95(errors.compensated, errors.stddev);
  evaluation.coverage_95_stated =
      coverage_95(errors.compensated, stated_sigmas(batch, cell()).transpose().replicate<3, 1>());
  evaluation.in_domain =
      static_cast<int>(std::count(errors.in_domain.begin(), errors.in_domain.end(), true));
  evaluation.nlpd = negative_log_density(errors.compensated, errors.stddev);
  if (inside_->bias)
    evaluation.bias_gain_z =
        paired_gain(errors.calibrated, errors.compensated, pose_groups(batch)).z();
  const LevelErrors::Rotations& rotation = errors.rotation;
  if (rotation.nominal.cols() > 0) {
    const auto rms = [](const Eigen::Matrix3Xd& turns) {
      return std::sqrt(turns.squaredNorm() / static_cast<double>(turns.cols()));
    };
    evaluation.orientation = {static_cast<int>(rotation.nominal.cols()), rms(rotation.nominal),
                              rms(rotation.calibrated), rms(rotation.compensated), std::nullopt};
    if (rotation.stddev.cols() > 0)
      evaluation.orientation->coverage_95 = coverage_95(rotation.compensated, rotation.stddev);
  }
  return evaluation;
}

PairedGain paired_gain(const CompensatedModel& before, const CompensatedModel& after,
                       const MeasurementBatch& batch) {
  return paired_gain(before.errors_B(batch).compensated, after.errors_B(batch).compensated,
                     pose_groups(batch));
}

}  // namespace trammel
