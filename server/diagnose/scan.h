#pragma once

#include <cstdint>
#include <vector>

#include "server/diagnose/family.h"

namespace trammel {

/// All families looked at together, against what chance alone brings: parametric bootstrap of the background on these
/// very poses.
struct Scan {
  std::vector<Best> best;       ///< a family each
  std::vector<double> penalty;  ///< nat: what a family reaches by chance (it may search over many members)
  Eigen::VectorXd null_score;   ///< the best score of all families in each draw, ascending
  double limit = 0;             ///< nat: score that the best of all reaches by chance in 1 of 100 batches

  [[nodiscard]] double score(std::size_t family) const { return best[family].evidence - penalty[family]; }
  /// Chance that the best of all reaches a score with nothing there; beyond the draws by their exponential tail.
  [[nodiscard]] double p_value(double score) const;
  /// The family with the best score among those `admitted`; empty where none has any.
  template <typename Admitted>
  [[nodiscard]] std::optional<std::size_t> strongest(const Admitted& admitted) const {
    std::optional<std::size_t> found;
    for (std::size_t f = 0; f < best.size(); ++f) {
      if (admitted(f) && best[f].evidence > 0 && (!found || score(f) > score(*found))) found = f;
    }
    return found;
  }
};

/// R x draws: samples of the background's whitened rows.
[[nodiscard]] Eigen::MatrixXd draw_null(const Background& background, Eigen::Index draws, std::uint64_t seed);

/// Scans `data` (R, whitened) and the draws `null` (R x D).
[[nodiscard]] Scan scan(const std::vector<FamilyPtr>& families, const Background& background,
                        const Eigen::VectorXd& data, const Eigen::MatrixXd& null);

}  // namespace trammel
