#pragma once

#include <string>
#include <vector>

#include "tests/support/hidden_case.h"

/// The best result that is possible with knowledge of the truth.
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
/// The causes closest to the hidden one in a case with one effect, closest first. Causes with a
/// free order, and functions of a joint, come close to many effects and are left out.
[[nodiscard]] std::vector<Rival> closest_rivals(const HiddenCase& hidden);

/// The standard deviation of the only effect of a case, as a share of its size, beside the cell's
/// own sources and `rivals`, if `more` poses are measured as well.
[[nodiscard]] double relative_stddev(const HiddenCase& hidden,
                                     const std::vector<HiddenCause>& rivals,
                                     const std::vector<MeasuringPose>& more);

}  // namespace trammel::hidden
