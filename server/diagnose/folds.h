#pragma once

#include <functional>
#include <vector>

#include "server/diagnose/scan.h"

namespace trammel {

/// Poses held out in turn: short runs of poses that were measured one after the other, dealt to a few folds, so that
/// what creeps along with time does not leak from the poses next to a held-out one.
class Folds {
 public:
  explicit Folds(const LinearProblem& problem);

  [[nodiscard]] std::size_t count() const { return keep_.size(); }
  /// R ones and zeros: the rows that fold `k` learns from.
  [[nodiscard]] const Eigen::VectorXd& keep(std::size_t k) const { return keep_[k]; }

  /// R: every row less what the other folds' poses say of it, with `columns` in units of their priors.
  [[nodiscard]] Eigen::VectorXd held_out_residual(const Eigen::VectorXd& data, const Eigen::MatrixXd& columns) const;

  /// Sum of squares of the held-out rows, without and with the best of `families` as each fold by itself chooses it
  /// (score: evidence less penalty, of those `admitted`).
  struct Gain {
    double before = 0, after = 0;
  };
  [[nodiscard]] Gain gain_of_selection(const Eigen::VectorXd& data, const Eigen::MatrixXd& columns,
                                       const std::vector<FamilyPtr>& families, const Chance& chance,
                                       const std::function<bool(std::size_t)>& admitted) const;

 private:
  std::vector<Eigen::VectorXd> keep_;
};

}  // namespace trammel
