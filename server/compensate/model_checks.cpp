#include "server/compensate/model_checks.h"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace trammel {
namespace {

constexpr double kRigid = 1e-6;              // |RᵀR - 1|
constexpr double kMostMetres = 1e6;          // of a frame; no cell is larger
constexpr double kRounding = 1e-6;           // of a correlation
constexpr Eigen::Index kMostPoses = 20'000;  // that one training may have; a bias' memory grows with them
constexpr double kMostLog = 200;             // of a hyperparameter, whose square is still a number

Status check_frame(const Pose& X, const std::string& name) {
  if (!X.matrix().allFinite() || X.translation().norm() > kMostMetres)
    return refused("model: {}: its place is no length, limit {:g} m", name, kMostMetres);
  const Matrix3 R = X.linear();
  const double off = (R.transpose() * R - Matrix3::Identity()).cwiseAbs().maxCoeff();
  if (off > kRigid || R.determinant() < 0)
    return refused("model: {}: its rotation is not rigid, off by {:.3g}, limit {:g}", name, off, kRigid);
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

/// Scaled to correlations, because the parameters have units of their own.
Status check_covariance(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd variance = covariance.diagonal();
  for (Eigen::Index i = 0; i < variance.size(); ++i) {
    if (variance(i) < 0) return refused("model: parameter {} has the variance {:.3g}, below 0", i + 1, variance(i));
  }
  const Eigen::VectorXd scale = variance.unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 0.0; });
  Eigen::MatrixXd correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  for (Eigen::Index i = 0; i < variance.size(); ++i) {
    // A parameter that is known exactly goes with no other.
    if (variance(i) == 0 && (!covariance.row(i).isZero(0) || !covariance.col(i).isZero(0)))
      return refused("model: parameter {} has no variance but a covariance", i + 1);
  }
  const double skew = asymmetry(correlation);
  if (!(skew <= kRounding)) return refused("model: its covariance is not symmetric, off by {:.3g}", skew);
  correlation.diagonal().array() += kRounding * static_cast<double>(std::max<Eigen::Index>(variance.size(), 1));
  for (Eigen::Index i = 0; i < variance.size(); ++i) {
    if (variance(i) == 0) correlation(i, i) = 1;
  }
  if (variance.size() > 0 && correlation.llt().info() != Eigen::Success)
    return refused("model: its covariance is not positive semidefinite");
  return {};
}

Status check_size(const Eigen::MatrixXd& covariance, Eigen::Index P) {
  if (covariance.rows() == P && covariance.cols() == P) return {};
  return refused("model: a covariance of {} x {}, should be {} x {}", covariance.rows(), covariance.cols(), P, P);
}

Status check_parameters(const CompensatedModel::Parts& parts) {
  for (const IdentifiedParameter& p : parts.parameters) {
    if (p.stddev < 0) return refused("model: parameter {} has the stddev {:.3g}, below 0", p.parameter.name, p.stddev);
  }
  if (parts.rank < 0 || parts.rank > parts.physics.parameter_count())
    return refused("model: rank {}, limit 0 to {}", parts.rank, parts.physics.parameter_count());
  return {};
}

Status check_bias(const BiasState& bias) {
  if (bias.q.rows() > kMostPoses)
    return failure(ErrorCode::kTooLarge, "model: its bias has {} poses, limit {}", bias.q.rows(), kMostPoses);
  const auto beyond = [](const Eigen::MatrixXd& m) { return m.size() > 0 && m.cwiseAbs().maxCoeff() > kMostLog; };
  if (beyond(bias.hyperparameters) || beyond(bias.block_hyperparameters))
    return refused("model: a hyperparameter of its bias is beyond {}, as a logarithm", kMostLog);
  return {};
}

/// Where a bias was learned that was kept since: with all the standard sources, which it was told of.
Status check_origin(const CompensatedModel::Parts::BiasOrigin& origin, Eigen::Index P) {
  for (const std::string& name : standard_sources()) {
    const auto& sources = origin.physics.sources;
    if (std::none_of(sources.begin(), sources.end(),
                     [&](const auto& one) { return &one->cause() == find_cause(name); }))
      return refused("model: the physics that its bias was learned beside has no {}", name);
  }
  Status fine = check_frames(origin.physics, "where its bias was learned, ");
  if (fine) fine = check_size(origin.covariance, P);
  if (fine) fine = check_covariance(origin.covariance);
  return fine;
}

Status check_ranges(const CompensatedModel::Parts& parts) {
  if (!parts.q_min.allFinite() || !parts.q_max.allFinite() || !parts.extrapolation_slope.allFinite())
    return refused("model: a joint range is not finite");
  if (parts.q_min.size() == parts.q_max.size() && (parts.q_min.array() > parts.q_max.array()).any())
    return refused("model: a joint range ends before it begins");
  for (const auto& [tool, payload] : parts.trained_with) {
    const Cell& cell = *parts.physics.cell;
    if (!cell.tools.contains(tool) || (!payload.empty() && !cell.payloads.contains(payload)))
      return refused("model: trained with tool '{}' and payload '{}', which its cell does not have", tool, payload);
  }
  return {};
}

}  // namespace

Status check_parts(const CompensatedModel::Parts& parts) {
  Status fine = check_frames(parts.physics, "");
  const auto P = static_cast<Eigen::Index>(parts.physics.parameter_count());
  if (fine) fine = check_size(parts.covariance, P);
  if (fine) fine = check_parameters(parts);
  if (fine) fine = check_ranges(parts);
  if (fine && parts.bias) fine = check_bias(*parts.bias);
  if (fine && parts.rotation_bias) fine = check_bias(*parts.rotation_bias);
  if (fine) fine = check_covariance(parts.covariance);
  if (fine && parts.bias_origin) fine = check_origin(*parts.bias_origin, P);
  return fine;
}

}  // namespace trammel
