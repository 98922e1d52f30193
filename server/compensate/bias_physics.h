#pragma once

#include "server/bias/linear_block.h"
#include "server/error_sources/physical_model.h"

namespace trammel {

/// With rotations above positions: what a bias of the orientation is told.
[[nodiscard]] BiasFeatures turned(const BiasFeatures& features);

/// What a bias with blocks is told of the arm at a pose: by the same function when it is trained and when it answers.
/// Parameters are the model's own and, where it lacks them, those of the standard sources `base`, `geometry` and
/// `compliance` (`tool` where nobody knows the tool) at zero. So what an incomplete model leaves over is learned with
/// the shape of physics, and what identification left uncertain is part of the bias' own uncertainty. Immutable,
/// thread-safe.
class BiasPhysics {
 public:
  explicit BiasPhysics(const PhysicalModel& physics);

  /// At the model's values, exact derivatives.
  [[nodiscard]] BiasFeatures at(const PoseContext& context) const;
  /// m, in B: what the position makes of `shift` (P, prior standard deviations of each parameter) beyond
  /// `at(context).by_parameter * shift`.
  [[nodiscard]] Vector3 beyond_first_order(const PoseContext& context, const Eigen::VectorXd& shift) const;

 private:
  PhysicalModel whole_;
  Eigen::VectorXd prior_stddev_;  // P
};

}  // namespace trammel
