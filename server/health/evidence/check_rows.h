#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"
#include "server/plan/detectable.h"

namespace trammel::health {

/// A check's poses against the model: R rows, three of each position and three more of each
/// orientation, in B.
struct CheckRows {
  std::vector<std::string> pose_ids;
  std::vector<PoseContext> contexts;
  std::vector<Eigen::Index> first;  ///< row of each pose
  std::vector<Eigen::Index> count;  ///< 3 or 6
  std::vector<Pose> predicted;      ///< X_BT
  Eigen::VectorXd
      residual;  ///< R, m and rad: measured - predicted, with the base where it fits best
  Eigen::MatrixXd covariance;  ///< R x R: what a healthy robot's residuals have
  Eigen::MatrixXd by_base;     ///< R x 6; R x 3 where the base is turned as in the model
  Eigen::MatrixXd by_cause;    ///< R x K, as CauseEffects has them

  [[nodiscard]] std::size_t poses() const { return pose_ids.size(); }
  /// False where these poses do not say which way the base is turned, and stand where the model has
  /// them.
  [[nodiscard]] bool base_turns() const { return by_base.cols() == 6; }
};

/// The poses of the batch as the model is asked for them, without what is measured there.
[[nodiscard]] std::vector<PoseContext> contexts_of(const CompensatedModel& model,
                                                   const MeasurementBatch& batch);

/// `batch` has only rows that the model knows(). Positions at one place or on one line do not say
/// which way the base is turned. Without orientations it is then turned as in the model, if the
/// poses are where the model has them; otherwise they are refused, as are positions that do not say
/// where the base stands.
[[nodiscard]] Result<CheckRows> check_rows(const CompensatedModel& model,
                                           const MeasurementBatch& batch,
                                           const CauseEffects& effects);

}  // namespace trammel::health
