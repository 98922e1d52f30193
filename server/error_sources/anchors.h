#pragma once

#include <Eigen/Dense>
#include <functional>
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
  Eigen::Index place = -1;  ///< of the first of three: of the point, or offset and tilts of a plane
  Eigen::Index zero = -1;

  [[nodiscard]] bool is_open_plane() const;
  /// The anchor with its place and direction at these values.
  [[nodiscard]] Anchor at(const Eigen::VectorXd& values) const;
  [[nodiscard]] double zero_at(const Eigen::VectorXd& values) const;
};
/// The normal n of a plane that is tilted by t from its rough normal n0, with u and v across n0:
/// n = (n0 + t1 u + t2 v) / |n0 + t1 u + t2 v|, and its derivative by t.
struct TiltedNormal {
  Vector3 n = Vector3::UnitZ();
  Eigen::Matrix<double, 3, 2> by_tilt = Eigen::Matrix<double, 3, 2>::Zero();
};
[[nodiscard]] TiltedNormal tilted_normal(const Vector3& n0, const Eigen::Vector2d& t);
/// The t that leads from `n0` to `n`; the two must be less than 90 deg apart.
[[nodiscard]] Eigen::Vector2d tilt_to(const Vector3& n0, const Vector3& n);

/// The anchor `id` as the model has it. `said` is null where the model has no `anchors`, or none of
/// that id.
[[nodiscard]] PlacedAnchor placed_anchor(const PhysicalModel& model, const std::string& id);

/// The tool point in W at a pose, m, and, if `J` is given, its derivative by the P parameters
/// (3 x P).
using ToolPoint = std::function<Vector3(const PoseContext& context, Eigen::MatrixXd* J)>;

/// The predicted numbers of a gauge at a pose, m (Gauge::numbers()), and, if `jacobian` is given,
/// their derivative by the P parameters (numbers() x P). A reading is h(q) = l(p_WT(q), p_WA) +
/// zero, or h(q) - h(q') against another pose; a contact is p_WT(q) - p_WA; kApart is
/// |p_WT(q) - p_WT(q')|. All but kApart need the anchor in the model. The residual of each number
/// is the gauge's value less the prediction: every room takes it from here.
Eigen::VectorXd predicted_gauge(const PhysicalModel& model, const PoseContext& context,
                                const Gauge& gauge, const Eigen::VectorXd& values,
                                Eigen::MatrixXd* jacobian = nullptr);
/// The same with tool points from elsewhere.
Eigen::VectorXd predicted_gauge(const PhysicalModel& model, const ToolPoint& point,
                                const PoseContext& context, const Gauge& gauge,
                                const Eigen::VectorXd& values, Eigen::MatrixXd* jacobian = nullptr);

}  // namespace trammel
