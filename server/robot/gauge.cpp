#include "server/robot/gauge.h"

#include "server/base/check.h"

namespace trammel {

GaugedLength length_of(const Vector3& d) {
  const double length = d.norm();
  return {length, length > 0 ? Vector3(d / length) : Vector3::Zero()};
}

GaugedLength gauged_length(Gauge::Kind kind, const Anchor& anchor, const Vector3& p_W) {
  TRAMMEL_CHECK(anchor.p_W);
  const Vector3 d = p_W - *anchor.p_W;
  if (kind == Gauge::Kind::kDistance) return length_of(d);
  const Vector3& n = anchor.direction_W;
  switch (anchor.shape) {
    case Anchor::Shape::kPlane:
      return {n.dot(d), n};
    case Anchor::Shape::kRing: {
      const GaugedLength across = length_of(d - n.dot(d) * n);
      return {across.value - anchor.radius, across.by_point_W};
    }
    case Anchor::Shape::kPoint:
    case Anchor::Shape::kSphere:
      break;
  }
  const GaugedLength from_centre = length_of(d);
  return {from_centre.value - anchor.radius, from_centre.by_point_W};
}

}  // namespace trammel
