#pragma once

#include <cstdint>
#include <functional>

#include "server/bias/bias_model.h"
#include "server/tasks/train/left_out.h"

namespace trammel {

/// The factor by which the errors of a bias at left-out poses exceed its covariance; at least 1.
/// There are two reasons: predictions treat hyperparameters from few poses as exact, although they
/// fit these poses better than others; and the physics has absorbed a part of the noise before the
/// bias is learned. Fifths of the poses are left out in turn, and the physics is identified without
/// them (Stone 1974). With up to 200 observations the hyperparameters are learned anew, too.
///
/// Model: the error of a coordinate is normal with the variance f² v + sigma², where v is the
/// variance of bias and parameters and sigma the instrument's. f makes the sum of squares equal to
/// its expectation.
///
/// `problem`: the fit data of `bias`; `left_out`: of the same poses. 1 if too little is left to
/// identify from, or if `progress` gives up.
[[nodiscard]] double bias_spread(const BiasProblem& problem, const BiasModel& bias,
                                 const LeftOut& left_out, std::uint64_t seed,
                                 const std::function<bool(double share)>& progress);

}  // namespace trammel
