#pragma once

#include "server/health/evidence/refitted_rows.h"

/// The size of an effect, from its estimate.
namespace trammel::health {

/// m, and U(k=2).
struct Size {
  double rms = 0, u95 = 0;
};
/// The size of an effect of numbers w. Its square is w' `square` w.
[[nodiscard]] Size size_of(const Estimate& found, const Eigen::MatrixXd& square);
/// The size where a joint's angle is off by anything at each pose; `rms`: if it is one prior scale
/// everywhere.
[[nodiscard]] Size size_of_any(const Estimate& found, double rms);

}  // namespace trammel::health
