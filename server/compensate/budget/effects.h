#pragma once

#include <vector>

#include "server/compensate/budget/datum.h"
#include "server/compensate/budget/items.h"

/// Inside of the room: the effects of the lines on the poses, as vectors.
namespace trammel {

/// 3 x N each, m, in W. `total` = the sum of all others, exactly.
struct Effects {
  Eigen::Matrix3Xd total;               ///< measured minus the drawing
  std::vector<Eigen::Matrix3Xd> lines;  ///< of each item: the model minus the model without the
                                        ///< item
  Eigen::Matrix3Xd learned;             ///< of the bias
  Eigen::Matrix3Xd rest;                ///< measured minus compensated
  Eigen::Matrix3Xd together;            ///< the remainder, because lines act on one another
};
/// Measured minus predicted, 3 x N, m, in W: by the drawing, by the physics as identified, and with
/// the bias.
struct LeftAt {
  Eigen::Matrix3Xd drawing, physics, all;
};
[[nodiscard]] Effects effects_of(const LeftAt& left, const Datum& datum,
                                 const std::vector<BudgetItem>& items,
                                 const MeasurementBatch& positions);

/// The effect of all `items` together: the model minus the model with all of them on their drawing.
[[nodiscard]] Eigen::Matrix3Xd effect_of_all(const PhysicalModel& model,
                                             const std::vector<const BudgetItem*>& items,
                                             const MeasurementBatch& positions);

/// Removes from 3 x N vectors at poses the effect of small motions of the base and of each tool.
class BeyondFrames {
 public:
  BeyondFrames(const PhysicalModel& model, const MeasurementBatch& positions);
  [[nodiscard]] Eigen::Matrix3Xd operator()(const Eigen::Matrix3Xd& vectors) const;

 private:
  Eigen::MatrixXd basis_;  // 3N x K, orthonormal
};

}  // namespace trammel
