#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/compensate/compensated_model.h"
#include "server/compensate/domain.h"
#include "server/error_sources/anchors.h"
#include "server/measurement/gauges.h"

namespace trammel {

namespace {

/// The arm and the covariance of its parameters, with the anchors of its cell file if the model has
/// none of its own.
struct Gauging {
  PhysicalModel physics;
  Eigen::MatrixXd covariance;
};

Gauging gauging_of(const ModelParts& parts) {
  Gauging gauging{parts.physics, parts.covariance};
  const auto& sources = gauging.physics.sources;
  if (std::any_of(sources.begin(), sources.end(),
                  [](const auto& source) { return source->name() == kAnchors; }))
    return gauging;
  Result<ErrorSourcePtr> anchors =
      make_instrument_source(std::string(kAnchors), *parts.physics.cell);
  TRAMMEL_CHECK(anchors);
  const auto P = gauging.physics.values.size();
  const auto more = static_cast<Eigen::Index>((*anchors)->parameters().size());
  gauging.physics.sources.push_back(std::move(*anchors));
  gauging.physics.values.conservativeResize(P + more);
  gauging.physics.values.tail(more).setZero();
  gauging.covariance = Eigen::MatrixXd::Zero(P + more, P + more);
  gauging.covariance.topLeftCorner(P, P) = parts.covariance;
  return gauging;
}

/// A gauge at the poses that it compares, with the answers of the model there.
struct AskedGauge {
  Gauge gauge;  ///< its `minus` is the second of `poses`
  std::vector<PoseContext> poses;
  std::vector<ErrorPrediction> predictions;
  bool in_domain = true;

  /// The tool points of `place_B` in place of those of the model's parameters.
  [[nodiscard]] ToolPoint points(const Pose& X_WB, Pose ErrorPrediction::*place_B) const {
    return [this, X_WB, place_B](const PoseContext& context, Eigen::MatrixXd*) -> Vector3 {
      const std::size_t k = &context == gauge.minus.get() ? 1 : 0;
      return X_WB * (predictions[k].*place_B).translation();
    };
  }
};

/// The derivative of the gauge's numbers by the tool point of pose `k`, up to its sign: numbers
/// x 3.
Eigen::MatrixXd by_tool_point(const PhysicalModel& physics, const AskedGauge& asked,
                              std::size_t k) {
  const auto p_W = [&](std::size_t of) -> Vector3 {
    return physics.X_WB * asked.predictions[of].X_BT_predicted.translation();
  };
  switch (asked.gauge.kind) {
    case Gauge::Kind::kContact:
      return Matrix3::Identity();
    case Gauge::Kind::kApart:
      return length_of(p_W(0) - p_W(1)).by_point_W.transpose();
    case Gauge::Kind::kDistance:
    case Gauge::Kind::kTouch:
      break;
  }
  const Anchor anchor = placed_anchor(physics, asked.gauge.anchor).at(physics.values);
  return gauged_length(asked.gauge.kind, anchor, p_W(k)).by_point_W.transpose();
}

/// m², of each number by the predictions with the bias, without the instrument's noise.
Eigen::VectorXd variance_with_bias(const PhysicalModel& physics, const AskedGauge& asked) {
  const double tracker = std::pow(physics.cell->tracker.sigma, 2);
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(asked.gauge.numbers());
  for (std::size_t k = 0; k < asked.poses.size(); ++k) {
    const Eigen::MatrixXd along_B = by_tool_point(physics, asked, k) * physics.X_WB.linear();
    const Matrix3 true_B =
        asked.predictions[k].covariance_B - tracker * Matrix3::Identity();  // without the tracker
    variance += (along_B * true_B * along_B.transpose()).diagonal().cwiseMax(0.0);
  }
  return variance;
}

/// m², of each number by the parameters `J` and the model's own error, likewise. The joint
/// covariance of anchors and arm is known.
Eigen::VectorXd variance_without_bias(const Gauging& gauging, const ModelParts& parts,
                                      const AskedGauge& asked, const Eigen::MatrixXd& J) {
  const Domain domain{parts.q_min, parts.q_max, parts.prior_share_limit};
  Eigen::VectorXd variance = (J * gauging.covariance * J.transpose()).diagonal();
  for (const PoseContext& pose : asked.poses)
    variance.array() +=
        std::pow(parts.discrepancy, 2) +
        domain.growth(pose.q, parts.extrapolation_slope, gauging.physics.cell->robot);
  return variance;
}

/// Appends the numbers of one gauge.
void append(Eigen::VectorXd& all, const Eigen::VectorXd& more) {
  all.conservativeResize(all.size() + more.size());
  all.tail(more.size()) = more;
}

}  // namespace

CompensatedModel::GaugeErrors CompensatedModel::gauge_errors(const MeasurementBatch& batch) const {
  const Gauging gauging = gauging_of(parts());
  const PhysicalModel& physics = gauging.physics;
  const bool own = is_own(batch);
  GaugeErrors errors;
  for (std::size_t row = 0; row < batch.measurements.size(); ++row) {
    const Measurement& m = batch.measurements[row];
    if (!m.gauge) continue;
    AskedGauge asked{*m.gauge, {m.context}, {}};
    if (m.gauge->minus != nullptr) asked.poses.push_back(*m.gauge->minus);
    for (PoseContext& pose : asked.poses) {
      pose.served = !own;
      asked.predictions.push_back(predict(pose));
      asked.in_domain = asked.in_domain && asked.predictions.back().in_domain;
      pose = completed(pose);
    }
    if (m.gauge->minus != nullptr)
      asked.gauge.minus = std::make_shared<const PoseContext>(asked.poses[1]);
    const auto residual = [&](const Eigen::VectorXd& predicted) -> Eigen::VectorXd {
      return asked.gauge.value - predicted.array();
    };
    const auto at = [&](Pose ErrorPrediction::*place_B) {
      return residual(predicted_gauge(physics, asked.points(physics.X_WB, place_B), asked.poses[0],
                                      asked.gauge, physics.values));
    };
    Eigen::MatrixXd J;
    const Eigen::VectorXd calibrated =
        residual(predicted_gauge(physics, asked.poses[0], asked.gauge, physics.values, &J));
    const bool biased = static_cast<bool>(inside_->bias);
    const Eigen::VectorXd variance = biased ? variance_with_bias(physics, asked)
                                            : variance_without_bias(gauging, parts(), asked, J);
    const double noise = std::pow(m.sigma.value_or(cell().tracker.sigma), 2);
    append(errors.nominal, at(&ErrorPrediction::X_BT_nominal));
    append(errors.calibrated, calibrated);
    append(errors.compensated, biased ? at(&ErrorPrediction::X_BT_predicted) : calibrated);
    append(errors.stddev, (variance.array() + noise).sqrt());
    errors.rows.insert(errors.rows.end(), static_cast<std::size_t>(variance.size()), row);
    errors.in_domain.insert(errors.in_domain.end(), static_cast<std::size_t>(variance.size()),
                            asked.in_domain);
  }
  return errors;
}

}  // namespace trammel
