#pragma once

#include <optional>
#include <string>

namespace trammel {

/// What people are told of positions that were computed from the joints, as the log of a controller
/// has them: they agree with a model far better than the instrument can measure. `rms` is of the
/// differences of `poses` positions and the model, `sigma` of one coordinate as it is stated, both
/// in m. Empty where they do not agree so well.
[[nodiscard]] std::optional<std::string> computed_not_measured(double rms, double sigma, int poses);

}  // namespace trammel
