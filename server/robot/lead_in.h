#pragma once

#include <optional>
#include <vector>

#include "server/robot/chain.h"

/// How a pose is come to so that play and hysteresis of known joints are taken up.
///
/// A gear with play b to each side leaves its joint behind its motor by b. After a turn back the
/// motor runs 2 b before the joint follows; from there on the joint hangs back by b for certain, on
/// the side that it came from, until the gear turns back again. So the last motion must turn every
/// such gear one way, by more than 2 b.
///
/// The tool stands still before a part, which leaves it one free way: back along its own axis. The
/// lead-in ends with that line. A gear that turns far enough on it comes from the side that the
/// line says. One that hardly turns there (joint 1 under a vertical drill) is turned before, clear
/// of the part, in the sense in which the line goes on; where the line does not turn it at all,
/// either sense does. No gear turns back on the way, so what is taken up stays taken up.
namespace trammel {

/// A joint that does not stand where its motor does.
struct TakeUp {
  int joint = 0;   ///< from 0
  double way = 0;  ///< rad (m) of its gear: what takes it up
  int side = 1;    ///< +1 rising, -1 falling: to be taken where either side does
};

/// m: how far the tool goes back along its axis where nothing is known of the way to the part.
constexpr double kBackOff = 20e-3;

struct LeadIn {
  std::vector<int> sides;            ///< of each joint, as PoseContext::direction; 0: not known
  std::vector<JointVector> offsets;  ///< rad (m): in this order, what is added to the joints of the
                                     ///< pose; the last one is back along the tool's axis
};

/// The way to the joints `q`, along the tool's axis over `back_off` (m). Nothing where a limit or a
/// singular place lies on it, or where nothing is to be taken up.
[[nodiscard]] std::optional<LeadIn> lead_in(const Chain& robot, const JointVector& q,
                                            const Pose& X_FT, const std::vector<TakeUp>& take_ups,
                                            double back_off = kBackOff);

}  // namespace trammel
