#pragma once

#include <cstdint>
#include <functional>

#include "server/bias/bias_model.h"
#include "server/tasks/train/left_out.h"

namespace trammel {

/// The factor by which a bias misses poses that it was not learned from farther than its covariance
/// says; at least 1. Hyperparameters that were found from few poses are taken for exact by every
/// prediction, and fit these poses better than others; and what the physics fitted of the noise is
/// missing in what the bias is learned from. Fifths of the poses are left out by turns, the physics
/// found without them (Stone 1974); of up to 200 observations the hyperparameters, too.
///
/// Model: what is missed of a coordinate is normal with the variance f² v + sigma², v what bias and
/// parameters leave uncertain, sigma the instrument's. f is as large as makes the sum of squares
/// what it is expected to be.
///
/// `problem`: what `bias` was fitted to; `left_out`: of the same poses. 1 where too little is left
/// to identify from, or where `progress` gives up.
[[nodiscard]] double bias_spread(const BiasProblem& problem, const BiasModel& bias,
                                 const LeftOut& left_out, std::uint64_t seed,
                                 const std::function<bool(double share)>& progress);

}  // namespace trammel
