#include "server/error_sources/anchors.h"

#include "server/base/check.h"

namespace trammel {

namespace {

/// h(q), with its derivative added to `jacobian`, `sign` times.
double told_at(const PhysicalModel& model, const PoseContext& context, const Gauge& gauge,
               const PlacedAnchor& anchor, const Eigen::VectorXd& values, double sign,
               Eigen::RowVectorXd* jacobian) {
  Eigen::MatrixXd J;
  const Pose X_WT = model.pose_W(context, values, jacobian != nullptr ? &J : nullptr);
  const GaugedLength length =
      gauged_length(gauge.kind, *anchor.said, anchor.p_W(values), X_WT.translation());
  if (jacobian != nullptr) {
    *jacobian += sign * (length.by_point_W.transpose() * J.topRows<3>());
    if (anchor.place >= 0)
      jacobian->segment<3>(anchor.place) -= sign * length.by_point_W.transpose();
    if (anchor.zero >= 0) (*jacobian)(anchor.zero) += sign;
  }
  return length.value + anchor.zero_at(values);
}

}  // namespace

Vector3 PlacedAnchor::p_W(const Eigen::VectorXd& values) const {
  return place >= 0 ? Vector3(values.segment<3>(place)) : said->p_W.value_or(Vector3::Zero());
}

double PlacedAnchor::zero_at(const Eigen::VectorXd& values) const {
  return zero >= 0 ? values(zero) : said->zero.value_or(0);
}

PlacedAnchor placed_anchor(const PhysicalModel& model, const std::string& id) {
  PlacedAnchor placed;
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    if (const auto* instruments = dynamic_cast<const Instruments*>(source.get())) {
      const auto said = instruments->anchors().find(id);
      if (said != instruments->anchors().end() && instruments->name() == kAnchors)
        placed.said = &said->second;
      (instruments->name() == kAnchors ? placed.place : placed.zero) =
          instruments->place(id, first);
    }
    first += static_cast<Eigen::Index>(source->parameters().size());
  }
  return placed;
}

double predicted_gauge(const PhysicalModel& model, const PoseContext& context, const Gauge& gauge,
                       const Eigen::VectorXd& values, Eigen::RowVectorXd* jacobian) {
  const PlacedAnchor anchor = placed_anchor(model, gauge.anchor);
  TRAMMEL_CHECK(anchor.said != nullptr);
  if (jacobian != nullptr) jacobian->setZero(values.size());
  double told = told_at(model, context, gauge, anchor, values, 1, jacobian);
  if (gauge.minus != nullptr)
    told -= told_at(model, *gauge.minus, gauge, anchor, values, -1, jacobian);
  return told;
}

}  // namespace trammel
