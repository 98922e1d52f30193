#include "server/diagnose/prove/own_residuals.h"

#include <algorithm>
#include <cmath>

#include "server/diagnose/evidence/background.h"
#include "server/measurement/pose_groups.h"

namespace trammel::cause_search {

namespace {

constexpr Eigen::Index kBlocks = 30;  // of a batch: 2^30 different draws
constexpr double kLeastFreeOfAFit =
    0.05;  // share of freedom, however many parameters the model has

}  // namespace

OwnResiduals::OwnResiduals(const LinearProblem& problem)
    : problem_(problem), block_of_(static_cast<std::size_t>(problem.poses()), 0) {
  const Background fit(problem.nuisance());
  const double rows = static_cast<double>(problem.rows());
  const double freedom = std::max(kLeastFreeOfAFit, 1 - fit.root().squaredNorm() / rows);
  left_ = fit.project(problem.residual()) / std::sqrt(freedom);
  const std::vector<PoseGroup> groups = pose_groups(problem.batch());
  const Eigen::Index length = std::max(Eigen::Index{1}, std::ssize(groups) / kBlocks);
  for (Eigen::Index g = 0; g < std::ssize(groups); ++g) {
    for (const Eigen::Index pose : groups[static_cast<std::size_t>(g)])
      block_of_[static_cast<std::size_t>(pose)] = g / length;
    blocks_ = g / length + 1;
  }
}

Eigen::VectorXd OwnResiduals::drawn(SeededRandom& random) const {
  std::vector<double> sign(static_cast<std::size_t>(blocks_));
  std::generate(sign.begin(), sign.end(), [&] { return random.uniform(0, 1) < 0.5 ? -1.0 : 1.0; });
  Eigen::VectorXd drawn = left_;
  for (Eigen::Index i = 0; i < problem_.poses(); ++i)
    drawn.segment(problem_.first_row(i), problem_.row_count(i)) *=
        sign[static_cast<std::size_t>(block_of_[static_cast<std::size_t>(i)])];
  return drawn;
}

MeasurementBatch OwnResiduals::measured(const Eigen::VectorXd& whitened) const {
  const Eigen::VectorXd distance = whitened.cwiseQuotient(problem_.weight());
  MeasurementBatch batch = problem_.batch();
  for (Eigen::Index i = 0; i < problem_.poses(); ++i) {
    Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    const Pose X_WT = problem_.model().pose_W(m.context);
    const Eigen::Index row = problem_.first_row(i);
    m.p_W = X_WT.translation() + distance.segment<3>(row);
    if (m.R_WT) m.R_WT = rotation_exp(distance.segment<3>(row + 3)) * X_WT.linear();
  }
  return batch;
}

}  // namespace trammel::cause_search
