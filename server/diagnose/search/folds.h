#pragma once

#include <functional>
#include <vector>

#include "server/diagnose/search/scan.h"

namespace trammel::cause_search {

/// Poses held out in turn: short runs of consecutively measured poses, dealt to a few folds, so
/// that a slow drift does not leak from the neighbours of a held-out pose. All rows of a joint
/// vector are one pose. Every fold fits `columns` (R x p, whitened, in units of priors) to the rows
/// of all other folds.
class Folds {
 public:
  Folds(const LinearProblem& problem, Eigen::MatrixXd columns);

  [[nodiscard]] std::size_t count() const { return held_.size(); }

  /// R: the residual of every row of `data` after a fit of all columns to the poses of the other
  /// folds.
  [[nodiscard]] Eigen::VectorXd held_out_residual(const Eigen::VectorXd& data) const;
  /// R: likewise by a fit of the columns in `chosen` alone, which may be none.
  [[nodiscard]] Eigen::VectorXd held_out_residual(const Eigen::VectorXd& data,
                                                  const std::vector<Eigen::Index>& chosen) const;

  /// Sum of squares of the held-out rows: without any family, and with the best `admitted` one,
  /// which every fold chooses by itself.
  struct Gain {
    double before = 0, after = 0;
  };
  [[nodiscard]] Gain gain_of_selection(const Eigen::VectorXd& data,
                                       const std::vector<FamilyPtr>& families, const Chance& chance,
                                       const std::function<bool(std::size_t)>& admitted) const;

 private:
  [[nodiscard]] Eigen::MatrixXd information_without(std::size_t fold) const;
  /// R: the residual of `data` after a fit of the background and of `columns` to the rows with
  /// `keep` 1. First the columns are fitted to the residual of the background, then the background
  /// to the rest.
  [[nodiscard]] Eigen::VectorXd rest_beside(const Background& background,
                                            const Eigen::VectorXd& keep,
                                            const Eigen::MatrixXd& columns,
                                            const Eigen::VectorXd& data) const;

  Eigen::MatrixXd columns_;
  std::vector<std::vector<Eigen::Index>> held_;  // rows
  std::vector<Eigen::MatrixXd> information_;  // of the held rows: the information that a fold lacks
  Eigen::MatrixXd total_;                     // of all rows, priors included
};

}  // namespace trammel::cause_search
