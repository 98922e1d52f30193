#pragma once

#include <optional>
#include <string>

namespace trammel {

/// The sentence about positions that were computed from the joints, as the log of a controller
/// has them: they agree with a model far better than the instrument can measure. `rms` is of the
/// differences of `poses` positions and the model, `sigma` of one coordinate as it is stated, both
/// in m. Empty where they do not agree so well.
[[nodiscard]] std::optional<std::string> computed_not_measured(double rms, double sigma, int poses);

/// The sentence about an `rms` (m) that is left when all of an arm was identified: as little as no
/// arm repeats, whatever the instrument is said to measure. The controller knows its arm's errors.
/// 0: not known.
[[nodiscard]] std::optional<std::string> computed_by_its_arm(double rms, int poses);

}  // namespace trammel
