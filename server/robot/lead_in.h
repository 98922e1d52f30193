#pragma once

#include <optional>
#include <vector>

#include "server/robot/chain.h"

/// An approach to a pose that takes up the play and hysteresis of known joints.
///
/// A gear with play b to each side lets its joint lag behind its motor by b. When the motor
/// reverses, it runs 2 b before the joint follows. From then on the joint lags by exactly b, until
/// the gear reverses again. So the last motion must turn every such gear one way, by more than 2 b.
///
/// In front of a part the tool has one free way: back along its own axis. The lead-in ends with
/// that line. If a gear turns far enough on the line, the line determines its side. If it hardly
/// turns there (joint 1 under a vertical drill), it turns beforehand, clear of the part, in the
/// sense in which the line continues. If the line does not turn it at all, either sense is right.
/// No gear reverses on the way, so its play stays taken up.
namespace trammel {

/// A joint that lags behind its motor.
struct TakeUp {
  int joint = 0;   ///< from 0
  double way = 0;  ///< rad (m): the turn of its gear that takes up the lag
  int side = 1;    ///< +1 rising, -1 falling: the sense to use if both are possible
};

/// m: the length of the line along the tool's axis if the way to the part is unknown.
constexpr double kBackOff = 20e-3;

struct LeadIn {
  std::vector<int> sides;            ///< of each joint, as PoseContext::direction; 0: not known
  std::vector<JointVector> offsets;  ///< rad (m): added to the joints of the pose, in this order;
                                     ///< the last one lies back along the tool's axis
};

/// The way to the joints `q`, along the tool's axis over `back_off` (m). Empty if a limit or a
/// singular place lies on it, or if there is nothing to take up.
[[nodiscard]] std::optional<LeadIn> lead_in(const Chain& robot, const JointVector& q,
                                            const Pose& X_FT, const std::vector<TakeUp>& take_ups,
                                            double back_off = kBackOff);

}  // namespace trammel
