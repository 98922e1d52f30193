#pragma once

#include <Eigen/Dense>
#include <string>

#include "server/error_sources/instruments.h"
#include "server/error_sources/physical_model.h"
#include "server/robot/gauge.h"

/// The parameters of instruments that measure one number: the places of their anchors, and the
/// offsets of their readings. A model lists them as the sources `anchors` and `instrument_zero`,
/// with values and covariances beside those of the arm. They are not errors of the robot: they move
/// no tool, and diagnosis does not look for them.
namespace trammel {

/// An anchor in a model: the values from the cell file, and the positions of the others among the
/// parameters (-1: not a parameter).
struct PlacedAnchor {
  const Anchor* said = nullptr;
  Eigen::Index place = -1;  ///< of the first of three
  Eigen::Index zero = -1;

  [[nodiscard]] Vector3 p_W(const Eigen::VectorXd& values) const;
  [[nodiscard]] double zero_at(const Eigen::VectorXd& values) const;
};
/// The anchor `id` as the model has it. `said` is null where the model has no `anchors`, or none of
/// that id.
[[nodiscard]] PlacedAnchor placed_anchor(const PhysicalModel& model, const std::string& id);

/// The predicted reading of the instrument at a pose, m, and, if `jacobian` is given, its
/// derivative by the P parameters. h(q) = l(p_WT(q), p_WA) + zero; a gauge that is read against
/// another pose gives h(q) - h(q'). The model must have the anchor.
double predicted_gauge(const PhysicalModel& model, const PoseContext& context, const Gauge& gauge,
                       const Eigen::VectorXd& values, Eigen::RowVectorXd* jacobian = nullptr);

}  // namespace trammel
