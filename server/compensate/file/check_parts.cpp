#include "server/compensate/file/check_parts.h"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace trammel::model_file {
namespace {

constexpr double kRigid = 1e-6;         // |RᵀR - 1|: rounding of a rotation is far below
constexpr double kMostStretched = 0.1;  // of a session's lengths: a tenth is no instrument's scale
constexpr double kMostMetres = 1e6;     // of a frame: no cell is larger
constexpr double kCorrelationRounding = 1e-6;  // of a matrix that was symmetric and positive
                                               // semidefinite before rounding
constexpr Eigen::Index kMostTrainingPoses =
    20'000;                       // of one training: the memory of a bias grows with their number
constexpr double kMostLog = 200;  // of a hyperparameter: its square is still a number

Status check_frame(const Pose& X, const std::string& name) {
  if (!X.matrix().allFinite() || X.translation().norm() > kMostMetres)
    return refused("model: {}: its place is no length, limit {:g} m", name, kMostMetres).of(name);
  const Matrix3 R = X.linear();
  const double off = (R.transpose() * R - Matrix3::Identity()).cwiseAbs().maxCoeff();
  if (R.determinant() < 0)
    return refused("model: {}: its rotation is a mirror image, determinant {:.3g}", name,
                   R.determinant())
        .of(name)
        .beyond(R.determinant(), 0);
  if (off > kRigid)
    return refused("model: {}: its rotation is not rigid, off by {:.3g}, limit {:g}", name, off,
                   kRigid)
        .of(name)
        .beyond(off, kRigid);
  return {};
}

Status check_frames(const PhysicalModel& physics, const std::string& whose) {
  Status fine = check_frame(physics.X_WB, whose + "base");
  for (const auto& [name, X_FT] : physics.tools) {
    if (fine) fine = check_frame(X_FT, whose + "tool " + name);
  }
  return fine;
}

double asymmetry(const Eigen::MatrixXd& m) {
  double most = 0;
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) most = std::max(most, std::abs(m(i, j) - m(j, i)));
  }
  return most;
}

/// Checked as correlations, because each parameter has its own unit.
Status check_covariance(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd variance = covariance.diagonal();
  for (Eigen::Index i = 0; i < variance.size(); ++i) {
    if (variance(i) < 0)
      return refused("model: parameter {} has the variance {:.3g}, below 0", i + 1, variance(i))
          .of("covariance")
          .beyond(variance(i), 0);
  }
  const Eigen::VectorXd scale =
      variance.unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 0.0; });
  Eigen::MatrixXd correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  for (Eigen::Index i = 0; i < variance.size(); ++i) {
    // A parameter that is known exactly cannot be correlated.
    if (variance(i) == 0 && (!covariance.row(i).isZero(0) || !covariance.col(i).isZero(0)))
      return refused("model: parameter {} has no variance but a covariance", i + 1)
          .of("covariance");
  }
  const double skew = asymmetry(correlation);
  if (!(skew <= kCorrelationRounding))
    return refused("model: its covariance is not symmetric, off by {:.3g}", skew)
        .of("covariance")
        .beyond(skew, kCorrelationRounding);
  correlation.diagonal().array() +=
      kCorrelationRounding * static_cast<double>(std::max<Eigen::Index>(variance.size(), 1));
  for (Eigen::Index i = 0; i < variance.size(); ++i) {
    if (variance(i) == 0) correlation(i, i) = 1;
  }
  if (variance.size() > 0 && correlation.llt().info() != Eigen::Success)
    return refused("model: its covariance is not positive semidefinite").of("covariance");
  return {};
}

Status check_size(const Eigen::MatrixXd& covariance, Eigen::Index P) {
  if (covariance.rows() == P && covariance.cols() == P) return {};
  return refused("model: a covariance of {} x {}, should be {} x {}", covariance.rows(),
                 covariance.cols(), P, P)
      .of("covariance")
      .beyond(covariance.rows(), P);
}

Status check_parameters(const ModelParts& parts) {
  for (const IdentifiedParameter& p : parts.parameters) {
    if (p.stddev < 0)
      return refused("model: parameter {} has the stddev {:.3g}, below 0", p.parameter.name,
                     p.stddev)
          .of(p.parameter.name)
          .beyond(p.stddev, 0);
  }
  if (parts.rank < 0 || parts.rank > parts.physics.parameter_count())
    return refused("model: rank {}, limit 0 to {}", parts.rank, parts.physics.parameter_count())
        .of("rank")
        .beyond(parts.rank, parts.rank < 0 ? 0 : parts.physics.parameter_count());
  return {};
}

Status check_bias(const BiasState& bias) {
  if (bias.q.rows() > kMostTrainingPoses)
    return failure(ErrorCode::kTooLarge, "model: its bias has {} poses, limit {}", bias.q.rows(),
                   kMostTrainingPoses)
        .of("bias")
        .beyond(bias.q.rows(), kMostTrainingPoses);
  const auto beyond = [](const Eigen::MatrixXd& m) {
    return m.size() > 0 && m.cwiseAbs().maxCoeff() > kMostLog;
  };
  if (beyond(bias.hyperparameters) || beyond(bias.block_hyperparameters))
    return refused("model: a hyperparameter of its bias is beyond {}, as a logarithm", kMostLog)
        .of("bias");
  return {};
}

/// Checks the physics beside which a kept bias was learned: it has all the standard sources.
Status check_origin(const ModelParts::BiasOrigin& origin, Eigen::Index P) {
  for (const std::string& name : standard_sources()) {
    const auto& sources = origin.physics.sources;
    if (std::none_of(sources.begin(), sources.end(),
                     [&](const auto& one) { return &one->cause() == find_cause(name); }))
      return refused("model: the physics that its bias was learned beside has no {}", name)
          .of("bias")
          .with_text(name);
  }
  Status fine = check_frames(origin.physics, "bias_origin: ");
  if (fine) fine = check_size(origin.covariance, P);
  if (fine) fine = check_covariance(origin.covariance);
  return fine;
}

Status check_ranges(const ModelParts& parts) {
  if (!parts.q_min.allFinite() || !parts.q_max.allFinite() ||
      !parts.extrapolation_slope.allFinite())
    return refused("model: a joint range is not finite").of("joint_ranges");
  if (parts.q_min.size() == parts.q_max.size() && (parts.q_min.array() > parts.q_max.array()).any())
    return refused("model: a joint range ends before it begins").of("joint_ranges");
  for (const auto& [tool, payload] : parts.trained_with) {
    const Cell& cell = *parts.physics.cell;
    if (!cell.tools.contains(tool) || (!payload.empty() && !cell.payloads.contains(payload)))
      return refused("model: trained with tool '{}' and payload '{}', which its cell does not have",
                     tool, payload)
          .of("trained_with")
          .with_text(tool);
  }
  return {};
}

Status check_measured(const ModelParts& parts) {
  const WhatWasMeasured& measured = *parts.measured;
  const auto joints = static_cast<std::size_t>(parts.physics.cell->robot.size());
  if (measured.approaches.size() != joints)
    return refused("model: measured: sides of approach of {} joints, its robot has {}",
                   measured.approaches.size(), joints)
        .of("measured")
        .beyond(measured.approaches.size(), joints);
  if ((measured.lower.array() > measured.upper.array()).any() || measured.reach.value_or(0) < 0)
    return refused("model: measured: its volume ends before it begins").of("measured");
  constexpr int kNeeded = WhatWasMeasured::kDirections;
  if (const auto given = measured.outline.size(); given != 0 && given != kNeeded)
    return refused("model: measured: an outline in {} directions, they are {}", given, kNeeded)
        .of("measured")
        .beyond(given, kNeeded);
  return {};
}

Status check_sessions(const ModelParts& parts) {
  for (const Change& change : parts.changes) {
    if (change.session >= parts.sessions.size())
      return refused("model: a change since session {}, it has {}", change.session + 1,
                     parts.sessions.size())
          .of("changes")
          .beyond(change.session + 1, parts.sessions.size());
  }
  const auto finite = [](const SessionSetting& session) {
    return session.X_WS.matrix().allFinite() && std::abs(session.scale) < kMostStretched;
  };
  if (!std::all_of(parts.sessions.begin(), parts.sessions.end(), finite))
    return refused("model: where a session stood is not finite").of("sessions");
  return {};
}

}  // namespace

Status check_parts(const ModelParts& parts) {
  Status fine = check_frames(parts.physics, "");
  const auto P = static_cast<Eigen::Index>(parts.physics.parameter_count());
  if (fine) fine = check_size(parts.covariance, P);
  if (fine) fine = check_parameters(parts);
  if (fine) fine = check_ranges(parts);
  if (fine && parts.measured) fine = check_measured(parts);
  if (fine) fine = check_sessions(parts);
  if (fine && parts.bias) fine = check_bias(*parts.bias);
  if (fine && parts.rotation_bias) fine = check_bias(*parts.rotation_bias);
  if (fine) fine = check_covariance(parts.covariance);
  if (fine && parts.bias_origin) fine = check_origin(*parts.bias_origin, P);
  return fine;
}

}  // namespace trammel::model_file
