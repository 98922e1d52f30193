#pragma once

#include "server/diagnose/evidence/linear_problem.h"
#include "server/numerics/seeded_random.h"

namespace trammel::cause_search {

/// The residuals of a problem's batch under its model, as noise to draw from. In a draw, blocks of
/// poses that follow one another keep or change their sign together (wild bootstrap: Cameron,
/// Gelbach, Miller 2008). So each residual stays at its pose and keeps its size and its direction.
/// Correlations over a few poses remain, and dependence on joints or time vanishes. Rows of one
/// joint vector have one sign. The fit has absorbed a part of the noise, so the draws are scaled up
/// to the full noise.
class OwnResiduals {
 public:
  /// `problem` outlives it.
  explicit OwnResiduals(const LinearProblem& problem);

  /// R, whitened.
  [[nodiscard]] Eigen::VectorXd drawn(SeededRandom& random) const;
  /// The batch that would have been measured if `whitened` (R) were the residual of the model.
  [[nodiscard]] MeasurementBatch measured(const Eigen::VectorXd& whitened) const;

 private:
  const LinearProblem& problem_;
  Eigen::VectorXd left_;                // R, whitened
  std::vector<Eigen::Index> block_of_;  // of each pose
  Eigen::Index blocks_ = 0;
};

}  // namespace trammel::cause_search
