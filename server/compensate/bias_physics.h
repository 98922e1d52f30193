#pragma once

#include <utility>

#include "server/bias/kernels/linear_block.h"
#include "server/error_sources/physical_model.h"

namespace trammel {

/// With rotations above positions: what a bias of the orientation is told.
[[nodiscard]] BiasFeatures turned(const BiasFeatures& features);

/// The base and a tool of an arm as it is served, errors and all.
[[nodiscard]] Pose served_base(const PhysicalModel& physics);
[[nodiscard]] Pose served_tool(const PhysicalModel& physics, const std::string& tool);

/// What a bias with blocks is told of the arm at a pose: by the same function when it is trained and when it answers.
/// Parameters are the model's own and, where it lacks them, those of the standard sources `base`, `geometry` and
/// `compliance` (`tool` where nobody knows the tool) at zero. So what an incomplete model leaves over is learned with
/// the shape of physics, and what identification left uncertain is part of the bias' own uncertainty. Immutable,
/// thread-safe.
class BiasPhysics {
 public:
  explicit BiasPhysics(const PhysicalModel& physics);
  /// Of a bias that was learned elsewhere: `whole` has all the parameters that it knew.
  [[nodiscard]] static BiasPhysics learned_at(PhysicalModel whole) { return BiasPhysics(std::move(whole), {}); }
  /// The same arm with other tools: `now` says where they are, errors and all. Those that stayed stay bit for bit.
  [[nodiscard]] BiasPhysics with_tools_of(const PhysicalModel& now) const;
  /// How what was learned in B then is turned in B now: it belongs to the arm, which a source may have turned in B.
  [[nodiscard]] Matrix3 turn_to(const PhysicalModel& now) const;
  /// All that the parameters stand for.
  [[nodiscard]] const PhysicalModel& whole() const { return whole_; }

  /// At the model's values, exact derivatives.
  [[nodiscard]] BiasFeatures at(const PoseContext& context) const;
  /// m, in B: what the position makes of `shift` (P, prior standard deviations of each parameter) beyond
  /// `at(context).by_parameter * shift`.
  [[nodiscard]] Vector3 beyond_first_order(const PoseContext& context, const Eigen::VectorXd& shift) const;

 private:
  struct AsItIs {};
  BiasPhysics(PhysicalModel whole, AsItIs);

  PhysicalModel whole_;
  Eigen::VectorXd prior_stddev_;  // P
};

}  // namespace trammel
