#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/diagnose/families/family.h"

namespace trammel::cause_search {

/// The scores that chance alone gives at these poses, from a parametric bootstrap of the
/// background.
struct Chance {
  std::map<std::string, double>
      penalty;  ///< nat, by a family's label: the median of its score by chance (its search may be
                ///< wide), plus its prior improbability against other causes
  Eigen::VectorXd null_score;  ///< nat: the best score of all families in each draw, ascending
  double limit = 0;  ///< nat: the line, which the best of all passes in 3 of 1000 batches by chance

  [[nodiscard]] double penalty_of(const Family& family) const;
  /// nat: the score that the best of all passes by chance in `share` of the batches. `share` is
  /// below a tenth.
  [[nodiscard]] double limit_at(double share) const;
  /// Chance of such a score of the best of all with nothing to find. Beyond the draws it follows
  /// their exponential tail, not below kLeastPValue.
  [[nodiscard]] double p_value(double score) const;
};

/// R x draws: samples of whitened rows with the background as their only effect.
[[nodiscard]] Eigen::MatrixXd draw_null(const Background& background, Eigen::Index draws,
                                        std::uint64_t seed);

[[nodiscard]] Chance chance_of(const std::vector<FamilyPtr>& families, const Background& background,
                               Eigen::Index draws, std::uint64_t seed);

/// The evidence of every family about one data vector.
struct Scan {
  std::vector<Best> best;     ///< one a family
  std::vector<double> score;  ///< nat: evidence less penalty

  /// The family with the best score among those `admitted`; empty where none explains anything.
  template <typename Admitted>
  [[nodiscard]] std::optional<std::size_t> strongest(const Admitted& admitted) const {
    std::optional<std::size_t> found;
    for (std::size_t f = 0; f < best.size(); ++f) {
      if (admitted(f) && best[f].evidence > 0 && (!found || score[f] > score[*found])) found = f;
    }
    return found;
  }
};

/// Scans `data` (R, whitened). Families that are not `admitted` keep an empty best.
[[nodiscard]] Scan scan(const std::vector<FamilyPtr>& families, const View& view,
                        const Eigen::VectorXd& data, const Chance& chance,
                        const std::function<bool(std::size_t)>& admitted = {});

/// The family that scores best in each column of `data`, and its score; -1 and 0 where none scores
/// above 0.
struct Winners {
  std::vector<int> family;
  std::vector<double> score;
};
[[nodiscard]] Winners winners(const std::vector<FamilyPtr>& families, const Background& background,
                              const Eigen::MatrixXd& data, const Chance& chance,
                              const std::function<bool(std::size_t)>& admitted = {});

}  // namespace trammel::cause_search
