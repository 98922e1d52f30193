#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

/// Locates the anchors of instruments, before the refinement.
namespace trammel {

/// `specs` with `anchors` added if the batch has gauges, and with `instrument_zero` added if the
/// cell file declares the zero of one of their instruments unknown.
[[nodiscard]] Result<std::vector<std::string>> with_instruments(std::vector<std::string> specs,
                                                                const Cell& cell,
                                                                const MeasurementBatch& batch);

/// Refuses problems that gauges cannot solve: several set-ups of the instrument, or an unknown base
/// or tool if no row has a position.
[[nodiscard]] Status check_gauges(const PhysicalModel& model, const MeasurementBatch& batch);

/// Sets the values of the unknown anchors in `model`, from gauges read on their own and the tool
/// points of the model. It solves the linear equations of the squared distances and refines the
/// solution. A point of contacts is their mean, a plane is the one through its touches. Refuses an
/// anchor with fewer than 4 values, or one whose tool points lie on one line; a point with one
/// contact; and a plane more than 60 deg from its stated normal.
[[nodiscard]] Status locate_anchors(PhysicalModel& model, const MeasurementBatch& batch);

/// The point at these distances from tool points.
struct LocatedPoint {
  Vector3 p_W = Vector3::Zero();
  double off = 0;  ///< m: median of the remaining length errors
};
/// Empty for fewer than 4 points, and for points on one line.
[[nodiscard]] std::optional<LocatedPoint> locate_point(const std::vector<Vector3>& points_W,
                                                       const std::vector<double>& lengths);

}  // namespace trammel
