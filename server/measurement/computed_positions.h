#pragma once

#include <optional>
#include <string>

namespace trammel {

/// The sentence about positions that were computed from the joints, such as positions from a
/// controller's log: they agree with a model far better than the instrument can measure. `rms` is
/// the difference between `poses` positions and the model, `sigma` the stated one of one
/// coordinate, both in m. Empty if they do not agree that closely.
[[nodiscard]] std::optional<std::string> computed_not_measured(double rms, double sigma, int poses);

/// The sentence about an `rms` (m) that is left after a whole arm was identified, if it is below
/// the repeatability of every arm, whatever the instrument's sigma. Such positions come from a
/// controller that knows its arm's errors. `rms` 0: not known.
[[nodiscard]] std::optional<std::string> computed_by_its_arm(double rms, int poses);

}  // namespace trammel
