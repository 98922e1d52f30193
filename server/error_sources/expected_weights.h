#pragma once

#include "server/robot/arm_state.h"

namespace trammel {

/// The possible weight of an arm beyond the masses in its robot file.
struct ExpectedWeights {
  FirstMoments moment;  ///< 2 x n, kg m
  JointArray spread;    ///< n, kg m: standard deviation of either number of a link
};

/// The weights of an arm of that shape whose mass is spread evenly along its links. Without stated
/// masses they are as heavy, and as uncertain, as those of robots of the same reach. With stated
/// masses they are zero, with an uncertainty of a third.
[[nodiscard]] ExpectedWeights expected_weights(const Chain& chain);

}  // namespace trammel
