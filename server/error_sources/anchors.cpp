#include "server/error_sources/anchors.h"

#include "server/base/check.h"

namespace trammel {

namespace {

/// The derivative of a number by the place of `anchor`, from its derivative `by_point_W` by the
/// tool point, which is at `p_W`.
Eigen::RowVector3d by_anchor_place(const PlacedAnchor& anchor, const Eigen::VectorXd& values,
                                   const Vector3& by_point_W, const Vector3& p_W) {
  if (!anchor.is_open_plane()) return -by_point_W.transpose();
  const TiltedNormal normal =
      tilted_normal(anchor.said->direction_W, values.segment<2>(anchor.place + 1));
  Eigen::RowVector3d by;  // of n·p - offset
  by << -1, p_W.transpose() * normal.by_tilt;
  return by;
}

/// h(q), with its derivative added to `jacobian`, `sign` times.
double told_at(const ToolPoint& point, const PoseContext& context, const Gauge& gauge,
               const PlacedAnchor& anchor, const Eigen::VectorXd& values, double sign,
               Eigen::MatrixXd* jacobian) {
  Eigen::MatrixXd J;
  const Vector3 p_W = point(context, jacobian != nullptr ? &J : nullptr);
  const GaugedLength length = gauged_length(gauge.kind, anchor.at(values), p_W);
  if (jacobian != nullptr) {
    jacobian->row(0) += sign * (length.by_point_W.transpose() * J);
    if (anchor.place >= 0)
      jacobian->block<1, 3>(0, anchor.place) +=
          sign * by_anchor_place(anchor, values, length.by_point_W, p_W);
    if (anchor.zero >= 0) (*jacobian)(0, anchor.zero) += sign;
  }
  return length.value + anchor.zero_at(values);
}

/// p_WT - p_WA.
Eigen::VectorXd contact_at(const ToolPoint& point, const PoseContext& context,
                           const PlacedAnchor& anchor, const Eigen::VectorXd& values,
                           Eigen::MatrixXd* jacobian) {
  const Vector3 p_W = point(context, jacobian);
  if (jacobian != nullptr && anchor.place >= 0)
    jacobian->middleCols<3>(anchor.place) -= Matrix3::Identity();
  return p_W - *anchor.at(values).p_W;
}

/// |p_WT(q) - p_WT(q')|
double apart_at(const ToolPoint& point, const PoseContext& context, const PoseContext& other,
                Eigen::MatrixXd* jacobian) {
  Eigen::MatrixXd J, J_other;
  const bool derived = jacobian != nullptr;
  const Vector3 p_W = point(context, derived ? &J : nullptr);
  const GaugedLength length = length_of(p_W - point(other, derived ? &J_other : nullptr));
  if (derived) *jacobian = length.by_point_W.transpose() * (J - J_other);
  return length.value;
}

}  // namespace

TiltedNormal tilted_normal(const Vector3& n0, const Eigen::Vector2d& t) {
  const Vector3 u = n0.unitOrthogonal();
  const Vector3 v = n0.cross(u);
  const Vector3 d = n0 + t(0) * u + t(1) * v;
  TiltedNormal normal;
  normal.n = d.normalized();
  const Matrix3 across = (Matrix3::Identity() - normal.n * normal.n.transpose()) / d.norm();
  normal.by_tilt.col(0) = across * u;
  normal.by_tilt.col(1) = across * v;
  return normal;
}

Eigen::Vector2d tilt_to(const Vector3& n0, const Vector3& n) {
  const Vector3 u = n0.unitOrthogonal();
  return Eigen::Vector2d(n.dot(u), n.dot(n0.cross(u))) / n.dot(n0);
}

bool PlacedAnchor::is_open_plane() const {
  return place >= 0 && said != nullptr && said->shape == Anchor::Shape::kPlane;
}

Anchor PlacedAnchor::at(const Eigen::VectorXd& values) const {
  Anchor anchor = *said;
  if (is_open_plane()) {
    anchor.direction_W = tilted_normal(said->direction_W, values.segment<2>(place + 1)).n;
    anchor.p_W = values(place) * anchor.direction_W;
  } else if (place >= 0) {
    anchor.p_W = values.segment<3>(place);
  } else {
    anchor.p_W = said->p_W.value_or(Vector3::Zero());
  }
  return anchor;
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

Eigen::VectorXd predicted_gauge(const PhysicalModel& model, const ToolPoint& point,
                                const PoseContext& context, const Gauge& gauge,
                                const Eigen::VectorXd& values, Eigen::MatrixXd* jacobian) {
  if (jacobian != nullptr) jacobian->setZero(gauge.numbers(), values.size());
  if (gauge.kind == Gauge::Kind::kApart) {
    TRAMMEL_CHECK(gauge.minus != nullptr);
    return Eigen::VectorXd::Constant(1, apart_at(point, context, *gauge.minus, jacobian));
  }
  const PlacedAnchor anchor = placed_anchor(model, gauge.anchor);
  TRAMMEL_CHECK(anchor.said != nullptr);
  if (gauge.kind == Gauge::Kind::kContact)
    return contact_at(point, context, anchor, values, jacobian);
  double told = told_at(point, context, gauge, anchor, values, 1, jacobian);
  if (gauge.minus != nullptr)
    told -= told_at(point, *gauge.minus, gauge, anchor, values, -1, jacobian);
  return Eigen::VectorXd::Constant(1, told);
}

Eigen::VectorXd predicted_gauge(const PhysicalModel& model, const PoseContext& context,
                                const Gauge& gauge, const Eigen::VectorXd& values,
                                Eigen::MatrixXd* jacobian) {
  const ToolPoint by_model = [&](const PoseContext& pose, Eigen::MatrixXd* J) -> Vector3 {
    const Pose X_WT = model.pose_W(pose, values, J);
    if (J != nullptr) *J = J->topRows<3>().eval();
    return X_WT.translation();
  };
  return predicted_gauge(model, by_model, context, gauge, values, jacobian);
}

}  // namespace trammel
