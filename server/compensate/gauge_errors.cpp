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

/// The value at one pose, and its variance without the instrument's noise if a bias contributes.
struct Told {
  double value = 0, variance = 0;
};

/// The reading by the predicted tool, with its bias.
Told told_with_bias(const ErrorPrediction& prediction, const Gauge& gauge,
                    const PlacedAnchor& anchor, const PhysicalModel& physics) {
  const GaugedLength length = gauged_length(gauge.kind, *anchor.said, anchor.p_W(physics.values),
                                            physics.X_WB * prediction.X_BT_predicted.translation());
  const Vector3 along_B = physics.X_WB.linear().transpose() * length.by_point_W;
  const double tracker = physics.cell->tracker.sigma * physics.cell->tracker.sigma;
  return {length.value + anchor.zero_at(physics.values),
          std::max(0.0, along_B.dot(prediction.covariance_B * along_B) -
                            tracker * along_B.squaredNorm())};
}

double nominal_of(const PhysicalModel& physics, const PoseContext& context, const Gauge& gauge,
                  const PlacedAnchor& anchor) {
  const auto at = [&](const PoseContext& pose) {
    return gauged_length(gauge.kind, *anchor.said, anchor.p_W(physics.values),
                         physics.nominal_pose_W(pose).translation())
               .value +
           anchor.zero_at(physics.values);
  };
  return at(context) - (gauge.minus != nullptr ? at(*gauge.minus) : 0);
}

}  // namespace

CompensatedModel::GaugeErrors CompensatedModel::gauge_errors(const MeasurementBatch& batch) const {
  const Gauging gauging = gauging_of(parts());
  const PhysicalModel& physics = gauging.physics;
  const Domain domain{parts().q_min, parts().q_max, parts().prior_share_limit};
  const bool own = is_own(batch);
  GaugeErrors errors;
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    if (batch.measurements[i].gauge) errors.rows.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(errors.rows.size());
  for (Eigen::VectorXd* one :
       {&errors.nominal, &errors.calibrated, &errors.compensated, &errors.stddev})
    one->resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[errors.rows[static_cast<std::size_t>(i)]];
    Gauge gauge = *m.gauge;
    const PlacedAnchor anchor = placed_anchor(physics, gauge.anchor);
    std::vector<PoseContext> poses = {m.context};
    if (gauge.minus != nullptr) poses.push_back(*gauge.minus);
    double variance = std::pow(m.sigma.value_or(cell().tracker.sigma), 2);
    Told with_bias;
    bool in_domain = true;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      poses[k].served = !own;
      const ErrorPrediction prediction = predict(poses[k]);
      in_domain = in_domain && prediction.in_domain;
      poses[k] = completed(poses[k]);
      const Told told = told_with_bias(prediction, gauge, anchor, physics);
      with_bias.value += k == 0 ? told.value : -told.value;
      with_bias.variance += told.variance;
      if (!inside_->bias) {
        variance += std::pow(parts().discrepancy, 2) +
                    domain.growth(poses[k].q, parts().extrapolation_slope, physics.cell->robot);
      }
    }
    if (gauge.minus != nullptr) gauge.minus = std::make_shared<const PoseContext>(poses[1]);
    Eigen::RowVectorXd J;
    const double calibrated = predicted_gauge(physics, poses[0], gauge, physics.values, &J);
    // Without a bias, the joint covariance of anchors and arm is known.
    variance +=
        inside_->bias ? with_bias.variance : (J * gauging.covariance * J.transpose()).value();
    errors.nominal(i) = gauge.value - nominal_of(physics, poses[0], gauge, anchor);
    errors.calibrated(i) = gauge.value - calibrated;
    errors.compensated(i) = gauge.value - (inside_->bias ? with_bias.value : calibrated);
    errors.stddev(i) = std::sqrt(variance);
    errors.in_domain.push_back(in_domain);
  }
  return errors;
}

}  // namespace trammel
