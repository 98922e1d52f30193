#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/diagnose/families/family.h"

namespace trammel {

/// What chance alone brings on these very poses: parametric bootstrap of the background.
struct Chance {
  std::map<std::string, double> penalty;  ///< nat, by label: what a family reaches by chance (it may search far), and
                                          ///< how little it is to be expected
  Eigen::VectorXd null_score;             ///< the best score of all families in each draw, ascending
  double limit = 0;                       ///< nat: score that the best of all reaches in 3 of 1000 batches

  [[nodiscard]] double penalty_of(const Family& family) const;
  /// nat: score that the best of all reaches with nothing there in `share` of all batches (below a tenth).
  [[nodiscard]] double limit_at(double share) const;
  /// Chance that the best of all reaches a score with nothing there; beyond the draws by their exponential tail.
  [[nodiscard]] double p_value(double score) const;
};

/// R x draws: samples of the background's whitened rows.
[[nodiscard]] Eigen::MatrixXd draw_null(const Background& background, Eigen::Index draws, std::uint64_t seed);

[[nodiscard]] Chance chance_of(const std::vector<FamilyPtr>& families, const Background& background, Eigen::Index draws,
                               std::uint64_t seed);

/// All families looked at together.
struct Scan {
  std::vector<Best> best;     ///< a family each
  std::vector<double> score;  ///< nat: evidence less penalty

  /// The family with the best score among those `admitted`; empty where none has any.
  template <typename Admitted>
  [[nodiscard]] std::optional<std::size_t> strongest(const Admitted& admitted) const {
    std::optional<std::size_t> found;
    for (std::size_t f = 0; f < best.size(); ++f) {
      if (admitted(f) && best[f].evidence > 0 && (!found || score[f] > score[*found])) found = f;
    }
    return found;
  }
};

/// Scans `data` (R, whitened); families that are not `admitted` keep an empty best.
[[nodiscard]] Scan scan(const std::vector<FamilyPtr>& families, const View& view, const Eigen::VectorXd& data,
                        const Chance& chance, const std::function<bool(std::size_t)>& admitted = {});

/// The family that scores best in each column of `data`, and its score; -1 and 0 where none has any.
struct Winners {
  std::vector<int> family;
  std::vector<double> score;
};
[[nodiscard]] Winners winners(const std::vector<FamilyPtr>& families, const Background& background,
                              const Eigen::MatrixXd& data, const Chance& chance,
                              const std::function<bool(std::size_t)>& admitted = {});

}  // namespace trammel
