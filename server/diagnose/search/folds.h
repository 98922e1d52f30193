#pragma once

#include <functional>
#include <vector>

#include "server/diagnose/search/scan.h"

namespace trammel::cause_search {

/// Poses held out in turn: short runs of poses that were measured one after the other, dealt to a
/// few folds, so that what creeps along with time does not leak from the poses next to a held-out
/// one. All rows of a joint vector are one pose. Every fold fits `columns` (R x p, whitened, in
/// units of priors) to the rows of all others.
class Folds {
 public:
  Folds(const LinearProblem& problem, Eigen::MatrixXd columns);

  [[nodiscard]] std::size_t count() const { return held_.size(); }

  /// R: what is left of every row of `data` by a fit of all columns to the poses of the other
  /// folds.
  [[nodiscard]] Eigen::VectorXd held_out_residual(const Eigen::VectorXd& data) const;
  /// R: likewise by a fit of the columns in `chosen` alone, which may be none.
  [[nodiscard]] Eigen::VectorXd held_out_residual(const Eigen::VectorXd& data,
                                                  const std::vector<Eigen::Index>& chosen) const;

  /// Sum of squares of the held-out rows: without any family, and with the best one of those
  /// `admitted`, which every fold chooses by itself.
  struct Gain {
    double before = 0, after = 0;
  };
  [[nodiscard]] Gain gain_of_selection(const Eigen::VectorXd& data,
                                       const std::vector<FamilyPtr>& families, const Chance& chance,
                                       const std::function<bool(std::size_t)>& admitted) const;

 private:
  [[nodiscard]] Eigen::MatrixXd information_without(std::size_t fold) const;
  /// R: what is left of `data` by a fit of the background and of `columns` to the rows for which
  /// `keep` is 1. First the columns are fitted to what the background leaves, then the background
  /// to the rest.
  [[nodiscard]] Eigen::VectorXd rest_beside(const Background& background,
                                            const Eigen::VectorXd& keep,
                                            const Eigen::MatrixXd& columns,
                                            const Eigen::VectorXd& data) const;

  Eigen::MatrixXd columns_;
  std::vector<std::vector<Eigen::Index>> held_;  // rows
  std::vector<Eigen::MatrixXd> information_;     // of the held rows: what a fold does not know
  Eigen::MatrixXd total_;                        // of all rows, priors included
};

}  // namespace trammel::cause_search
