#pragma once

#include <functional>
#include <optional>

#include "server/diagnose/search/search_result.h"

namespace trammel::cause_search {

/// The residual of the model found so far, and all families that may explain it. `found` outlives
/// it.
struct Standing {
  explicit Standing(const SearchResult& found);
  Standing(const Standing&) = delete;  // the families look at the problem
  Standing& operator=(const Standing&) = delete;

  [[nodiscard]] Scan scan(const Chance& chance) const;

  LinearProblem problem;
  std::vector<FamilyPtr> families;
  Eigen::MatrixXd columns;  ///< of the background
  Background background;
};

using Admitted = std::function<bool(std::size_t)>;

/// A scan, and which of its families may be chosen.
struct Choice {
  Scan seen;
  Admitted open;

  [[nodiscard]] std::optional<std::size_t> best() const { return seen.strongest(open); }
};

/// The best named cause. A step is replaced by the same cause from the first pose on if that
/// explains nearly as much. A cause is replaced by a simpler case of it in the same way: a map of a
/// joint's angle by an off-centre encoder.
[[nodiscard]] std::optional<std::size_t> best_named(const std::vector<FamilyPtr>& families,
                                                    const Choice& choice);

}  // namespace trammel::cause_search
