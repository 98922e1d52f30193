#pragma once

#include <Eigen/Dense>
#include <string>

#include "server/error_sources/instruments.h"
#include "server/error_sources/physical_model.h"
#include "server/robot/gauge.h"

/// The parameters of instruments that tell one number: where their anchors are, and what they
/// tell too much. A model has them in its list of sources as `anchors` and `instrument_zero`, with
/// values and covariances beside those of the arm. They are no errors of the robot: they move no
/// tool, and nobody looks for them.
namespace trammel {

/// An anchor in a model: what the cell file says, and where among the parameters the rest is; -1:
/// nowhere.
struct PlacedAnchor {
  const Anchor* said = nullptr;
  Eigen::Index place = -1;  ///< of the first of three
  Eigen::Index zero = -1;

  [[nodiscard]] Vector3 p_W(const Eigen::VectorXd& values) const;
  [[nodiscard]] double zero_at(const Eigen::VectorXd& values) const;
};
/// `said` is null where the model has no `anchors`, or none of that id.
[[nodiscard]] PlacedAnchor placed_anchor(const PhysicalModel& model, const std::string& id);

/// The number that the instrument would tell at a pose, m, and its derivative by the P parameters
/// where `jacobian` is given: h(q) = l(p_WT(q), p_WA) + zero, of a gauge told against another pose
/// h(q) - h(q'). The model must have the anchor.
double predicted_gauge(const PhysicalModel& model, const PoseContext& context, const Gauge& gauge,
                       const Eigen::VectorXd& values, Eigen::RowVectorXd* jacobian = nullptr);

}  // namespace trammel
