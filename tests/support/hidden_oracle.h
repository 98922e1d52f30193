#pragma once

#include <string>
#include <vector>

#include "tests/support/hidden_case.h"

/// What somebody who knows the truth could do.
namespace trammel::hidden {

/// mm: rms distance, on the poses set aside, of a fit of the cell's own sources and the true causes
/// to the others.
[[nodiscard]] double held_out_rms_mm(const HiddenCase& hidden);

/// Another cause, and how much of a hidden effect's strength it cannot make.
struct Rival {
  HiddenCause cause;
  double left = 0;          ///< share, of lambda
  Eigen::Index values = 0;  ///< numbers it has
};
/// The causes that come closest to what is hidden in a case with one effect, closest first. Causes
/// with an order to choose, and functions of a joint, come close to many things and are left out.
[[nodiscard]] std::vector<Rival> closest_rivals(const HiddenCase& hidden);

/// How uncertain the size of a case's only effect is, in shares of that size, beside the cell's own
/// sources and `rivals`, when `more` poses are measured as well.
[[nodiscard]] double relative_stddev(const HiddenCase& hidden,
                                     const std::vector<HiddenCause>& rivals,
                                     const std::vector<MeasuringPose>& more);

}  // namespace trammel::hidden
