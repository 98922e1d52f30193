#pragma once

#include <vector>

#include "server/calibrate/calibration.h"

/// Inside of the room: many parameter values predict the same poses; the datum chooses the ones
/// that a budget reports.
namespace trammel {

/// Values and covariance of a model in the datum of the budget. Parameters that the poses cannot
/// distinguish are counted once. In such a combination, the parameters that are smallest relative
/// to their usual size count as being on their drawing, and the others take over their effect.
/// Frames take as much as they can.
struct Datum {
  PhysicalModel model;         ///< with the values of the datum
  Eigen::MatrixXd covariance;  ///< P x P, SI, of these values; 0 where `on_drawing`
  /// A parameter that counts as being on its drawing, and its partners, which the poses cannot
  /// distinguish from it. No partners: the poses do not show it at all.
  struct OnDrawing {
    Eigen::Index parameter = 0;
    std::vector<Eigen::Index> with;
  };
  std::vector<OnDrawing> on_drawing;
  /// Parameters that the poses determine only together, though each has a value: their lines name
  /// each other.
  std::vector<std::vector<Eigen::Index>> told_together = {};
};

/// The identified parameters of an arm.
struct Identified {
  const PhysicalModel& physics;
  const std::vector<IdentifiedParameter>& parameters;
  const Eigen::MatrixXd& covariance;  ///< P x P, SI
};
/// `poses` are those of the budget. The covariance gives the information of the measurements.
/// `left`: 3 x N, m, in W, the residual of the physics at these poses. Where it is larger at the
/// poses that determine a parameter than elsewhere, the parameter's variance is larger, too (White
/// 1980). Null: not measured.
[[nodiscard]] Datum datum_of(const Identified& found, const std::vector<PoseContext>& poses,
                             const Eigen::Matrix3Xd* left = nullptr);

}  // namespace trammel
