#pragma once

#include "server/diagnose/evidence/linear_problem.h"
#include "server/numerics/seeded_random.h"

namespace trammel::cause_search {

/// The residuals that the model of a problem leaves of its batch, as noise to draw from. In a draw,
/// blocks of poses that follow one another keep or change their sign together (wild bootstrap:
/// Cameron, Gelbach, Miller 2008). So each residual stays at its pose with its size and its
/// direction, what lasts a few poses lasts, and nothing is left that goes with joints or time. Rows
/// of one joint vector have one sign. The fit has taken some of the noise; the draws are as much
/// larger.
class OwnResiduals {
 public:
  /// `problem` outlives it.
  explicit OwnResiduals(const LinearProblem& problem);

  /// R, whitened.
  [[nodiscard]] Eigen::VectorXd drawn(SeededRandom& random) const;
  /// The batch as it would have been measured if `whitened` (R) were what the model leaves over.
  [[nodiscard]] MeasurementBatch measured(const Eigen::VectorXd& whitened) const;

 private:
  const LinearProblem& problem_;
  Eigen::VectorXd left_;                // R, whitened
  std::vector<Eigen::Index> block_of_;  // of each pose
  Eigen::Index blocks_ = 0;
};

}  // namespace trammel::cause_search
