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
  Eigen::MatrixXd covariance;  ///< R x R, of a healthy robot's residuals
  Eigen::MatrixXd by_base;     ///< R x 6; R x 3 where the base is turned as in the model
  Eigen::MatrixXd by_cause;    ///< R x K, as CauseEffects has them

  [[nodiscard]] std::size_t poses() const { return pose_ids.size(); }
  /// False if these poses lie at the places that the model predicts, and do not determine the turn
  /// of the base.
  [[nodiscard]] bool base_turns() const { return by_base.cols() == 6; }
};

/// The poses of the batch as questions to the model, without their measurements.
[[nodiscard]] std::vector<PoseContext> contexts_of(const CompensatedModel& model,
                                                   const MeasurementBatch& batch);

/// `batch` has only rows that the model knows(). Positions at one place or on one line do not
/// determine the turn of the base. Without orientations the base then keeps the model's turn, if
/// the poses are where the model has them; otherwise they are refused. Positions that do not
/// determine the place of the base are refused as well.
[[nodiscard]] Result<CheckRows> check_rows(const CompensatedModel& model,
                                           const MeasurementBatch& batch,
                                           const CauseEffects& effects);

}  // namespace trammel::health
