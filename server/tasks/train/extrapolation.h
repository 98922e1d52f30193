#pragma once

#include "server/bias/bias_model.h"
#include "server/tasks/train/left_out.h"

namespace trammel {

/// The rate at which what the physics leaves over of the measured positions grows beyond `poses`: n
/// numbers, m of one coordinate's standard deviation by rad (m) of a joint out of range, see
/// Domain::growth(). Learned from the poses: for each joint and either end, the third of its range
/// there is left out, the parameters are identified on the rest, and the poses left out are asked;
/// what they miss by beyond the rest's own residual and the parameters' uncertainty is growth. The
/// worse end counts. A joint that hardly moved, or without whose ends too little is left to
/// identify from, takes the largest of the others.
[[nodiscard]] JointVector extrapolation_slope(const LeftOut& poses, const Chain& robot);
/// The slope where a bias with blocks, learned from all `poses`, is taken outside but for its
/// kernel: what it misses there, conditioned on the rest, beyond its own claims; where that cannot
/// be asked of any joint, the slope of the physics.
[[nodiscard]] JointVector extrapolation_slope(const LeftOut& poses, const Chain& robot,
                                              const BiasModel& bias);

}  // namespace trammel
