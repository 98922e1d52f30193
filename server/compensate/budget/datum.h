#pragma once

#include <vector>

#include "server/calibrate/calibration.h"

/// Inside of the room: which of all parameter values that predict the same poses a budget speaks
/// of.
namespace trammel {

/// Values and covariance of a model in the datum of the budget. What the poses cannot tell apart is
/// counted once: of the parameters of such a combination, those that are smallest beside what is
/// usual count as being on their drawing, and the others take what they would have. Frames take
/// what they can.
struct Datum {
  PhysicalModel model;         ///< with the values of the datum
  Eigen::MatrixXd covariance;  ///< P x P, SI, of these values; 0 where `on_drawing`
  /// A parameter that counts as being on its drawing, and those that the poses cannot tell from it;
  /// none: the poses do not show it at all.
  struct OnDrawing {
    Eigen::Index parameter = 0;
    std::vector<Eigen::Index> with;
  };
  std::vector<OnDrawing> on_drawing;
  /// Parameters that the poses tell together only, though each has a value: their lines name each
  /// other.
  std::vector<std::vector<Eigen::Index>> told_together = {};
};

/// The identified parameters of an arm.
struct Identified {
  const PhysicalModel& physics;
  const std::vector<IdentifiedParameter>& parameters;
  const Eigen::MatrixXd& covariance;  ///< P x P, SI
};
/// `poses`: those of the budget. What the measurements tell is taken from the covariance. `left`: 3
/// x N, m, in W, what the physics leaves at these poses: where that is larger at the poses that
/// tell a parameter than at others, its variance is larger, too (White 1980). Null: not measured.
[[nodiscard]] Datum datum_of(const Identified& found, const std::vector<PoseContext>& poses,
                             const Eigen::Matrix3Xd* left = nullptr);

}  // namespace trammel
