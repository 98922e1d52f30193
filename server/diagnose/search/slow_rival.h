#pragma once

#include <optional>

#include "server/diagnose/search/standing.h"

namespace trammel::cause_search {

/// The slow motion that may explain a cause said to move at once (a step) or steadily (a drift).
/// The same part moves, but on a course that warms up, follows the recorded temperature, or is any
/// smooth function of time.
struct SlowRival {
  Eigen::MatrixXd columns;  ///< R x k, whitened, of the fitted size
  std::vector<std::string> depends_on;
  std::string wanderer;  ///< the moving part, for people
  double gap = 0;        ///< nat: evidence beyond the cause's own
};
/// The slow rival of the family at `place`, as `seen`. Empty where it moves neither at once nor
/// steadily.
[[nodiscard]] std::optional<SlowRival> slow_rival(const Standing& standing, const Scan& seen,
                                                  std::size_t place);

}  // namespace trammel::cause_search
