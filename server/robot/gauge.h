#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

/// Instruments that give one number at a pose instead of a position: draw wires, ballbars and
/// ranges, which measure a distance; dial gauges and probes, which touch a surface. Also gauges
/// that know no place of their own: a spike that the tip meets, a bar between two poses.
namespace trammel {

/// The reference point of an instrument, under `anchors` in the cell file.
struct Anchor {
  enum class Shape { kPoint, kSphere, kPlane, kRing };
  Shape shape = Shape::kPoint;
  std::optional<Vector3>
      p_W;  ///< m: the point, a point of the plane, of the ring's axis; empty: unknown
  /// Unit vector: normal of the plane, away from its body; axis of the ring. Of a plane of unknown
  /// place its rough direction: the attitude is then unknown, too.
  Vector3 direction_W = Vector3::UnitZ();
  double radius = 0;            ///< m, of sphere or ring
  std::optional<double> sigma;  ///< m, of one reading of this instrument
  std::optional<double> zero;   ///< m: the offset of the readings; empty: calibration identifies it
  bool zero_open = false;  ///< true: the zero is certainly unknown; false: the data decide whether
                           ///< there is one
};
/// By their ids.
using Anchors = std::map<std::string, Anchor>;

/// The anchors of the cell file; empty for a cell without a file.
[[nodiscard]] Result<Anchors> anchors_of(const Cell& cell);

/// One reading of an instrument.
struct Gauge {
  enum class Kind {
    kDistance,  ///< from the tool point to the anchor's point
    kTouch,  ///< from the anchor's surface to the tool point, positive outside of a sphere, above a
             ///< plane, and beyond the wall of a ring that is touched from within
    kContact,  ///< the tool point is at the anchor's point: three numbers, all 0
    kApart,    ///< from the tool point at this pose to that at another one (bar, plate of holes)
  };
  Kind kind = Kind::kDistance;
  std::string anchor;      ///< empty for kApart
  double value = 0;        ///< m
  std::string minus_pose;  ///< id of the pose against which the value is read, or from which the
                           ///< tool point is kApart; empty: none
  std::shared_ptr<const PoseContext> minus;  ///< that pose

  /// The number of equations: 3 of a contact, otherwise 1.
  [[nodiscard]] int numbers() const { return kind == Kind::kContact ? 3 : 1; }
  /// True if an instrument was read. A contact, and a bar of one length, are no readings.
  [[nodiscard]] bool is_reading() const { return kind == Kind::kDistance || kind == Kind::kTouch; }
};

/// A distance, and its derivative by the tool point. The derivative by the point from which it is
/// measured is the negative.
struct GaugedLength {
  double value = 0;  ///< m
  Vector3 by_point_W = Vector3::Zero();
};
/// The length of `d`.
[[nodiscard]] GaugedLength length_of(const Vector3& d);
/// From `p_W` to `anchor`, whose point must be known, without any zero error; for kDistance and
/// kTouch.
[[nodiscard]] GaugedLength gauged_length(Gauge::Kind kind, const Anchor& anchor,
                                         const Vector3& p_W);

}  // namespace trammel
