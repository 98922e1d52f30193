#pragma once

#include "server/bias/bias_model.h"
#include "server/tasks/train/left_out.h"

namespace trammel {

/// The rate at which the residual of the physics grows beyond `poses`: n numbers, m of one
/// coordinate's standard deviation per rad (m) of a joint out of range, see Domain::growth(). It is
/// learned from the poses. For each joint and either end, the third of its range there is left out,
/// the parameters are identified on the rest, and the left-out poses are predicted. Growth is the
/// part of their error beyond the residual of the rest and the parameters' uncertainty. The worse
/// end counts. A joint that hardly moved, or without whose ends too little is left, takes the
/// largest rate of the others.
[[nodiscard]] JointVector extrapolation_slope(const LeftOut& poses, const Chain& robot);
/// The slope for a bias with blocks, learned from all `poses`, which is applied outside except for
/// its kernel. It grows with the part of the error there that exceeds the stated error, given the
/// rest. If no joint allows this test, it is the slope of the physics.
[[nodiscard]] JointVector extrapolation_slope(const LeftOut& poses, const Chain& robot,
                                              const BiasModel& bias);

}  // namespace trammel
