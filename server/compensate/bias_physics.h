#pragma once

#include <utility>

#include "server/bias/kernels/linear_block.h"
#include "server/error_sources/physical_model.h"

namespace trammel {

/// The features with rotations above positions: the features for a bias of the orientation.
[[nodiscard]] BiasFeatures turned(const BiasFeatures& features);

/// Base and tool of an arm in service, with all identified errors.
[[nodiscard]] Pose served_base(const PhysicalModel& physics);
[[nodiscard]] Pose served_tool(const PhysicalModel& physics, const std::string& tool);

/// The features of a pose for a bias with blocks, by one function for training and prediction.
/// Parameters are the model's own. If it lacks parameters of the standard sources `base`,
/// `geometry` and `compliance` (and `tool`, if a tool is unknown), these are added at zero. So the
/// bias can learn the errors of an incomplete model in the shape of physics, and the uncertainty of
/// identification is part of the bias' uncertainty. Immutable, thread-safe.
class BiasPhysics {
 public:
  explicit BiasPhysics(const PhysicalModel& physics);
  /// For a bias that was learned beside an earlier physics: `whole` has all the parameters of that
  /// time.
  [[nodiscard]] static BiasPhysics learned_at(PhysicalModel whole) {
    return BiasPhysics(std::move(whole), {});
  }
  /// The arm with the tools of `now`, with all their errors. Tools that did not move stay bit
  /// for bit.
  [[nodiscard]] BiasPhysics with_tools_of(const PhysicalModel& now) const;
  /// The rotation from B at that time to B of `now`: the bias belongs to the arm, which a source
  /// may have turned in B.
  [[nodiscard]] Matrix3 turn_to(const PhysicalModel& now) const;
  /// The model with all the parameters.
  [[nodiscard]] const PhysicalModel& whole() const { return whole_; }

  /// At the model's values, exact derivatives.
  [[nodiscard]] BiasFeatures at(const PoseContext& context) const;
  /// m, in B: how far the position moves with `shift` (P, in prior standard deviations of the
  /// parameters) beyond the first order, which is `at(context).by_parameter * shift`.
  [[nodiscard]] Vector3 beyond_first_order(const PoseContext& context,
                                           const Eigen::VectorXd& shift) const;

 private:
  struct AsItIs {};
  BiasPhysics(PhysicalModel whole, AsItIs);

  PhysicalModel whole_;
  Eigen::VectorXd prior_stddev_;  // P
};

}  // namespace trammel
