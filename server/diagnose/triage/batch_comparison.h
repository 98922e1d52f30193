#pragma once

#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/diagnose/diagnosis.h"

/// The fit of one explanation of a batch for triage(); the model is at the head of triage.cpp.
namespace trammel::batch_triage {

constexpr int kFewOutliers = 2;  ///< more than these may be a step

/// An explanation: the model and its free parameters, and the pose from which they are free.
struct Alternative {
  Cause cause;  ///< `cause` empty: none
  bool harmful = false;
  bool tracker_elsewhere = false;
  int first = 0;
  PhysicalModel model;
  std::vector<bool> free;  ///< the model's parameters that this alternative frees from pose `first`
                           ///< on
  std::vector<bool> base;  ///< by the tracker, at all poses
  Eigen::VectorXd known;   ///< values to start from
};

struct Fit {
  double score = 0;
  double misfit = 0;      ///< chi^2 per degree of freedom of the inliers
  double misfit_all = 0;  ///< the same of all poses
  bool explains = false;
  std::vector<int> outliers;
  Eigen::Matrix3Xd residual;  ///< m
  Eigen::Matrix3Xd turn;      ///< rad; 0 where no orientation is judged
};

struct Fitting;

/// One batch against one model: the data that all alternatives share.
class Comparison {
 public:
  Comparison(const CompensatedModel& model, const MeasurementBatch& batch);

  [[nodiscard]] int poses() const { return static_cast<int>(batch_.measurements.size()); }
  [[nodiscard]] const MeasurementBatch& batch() const { return batch_; }
  [[nodiscard]] const CompensatedModel& model() const { return model_; }

  [[nodiscard]] Fit fit(const Alternative& alternative) const;
  /// The base that fits the batch as it is; the base of `model` if the batch does not determine
  /// one.
  [[nodiscard]] Pose located_base(const PhysicalModel& model) const;

 private:
  [[nodiscard]] PoseContext as_served(const Measurement& m) const {
    PoseContext context = m.context;
    context.served = true;
    if (!context.temperature) context.temperature = model_.parts().temperature_mean;
    return context;
  }
  /// Sets the expected deviations of the orientations; a model without orientations judges none.
  void expect_rotations(const CompensatedModel::LevelErrors::Rotations& errors);
  /// The number of judged numbers: 6 for a pose, 3 without an orientation, or all.
  [[nodiscard]] Eigen::Index rows(int pose) const {
    return is_turned_[static_cast<std::size_t>(pose)] ? 6 : 3;
  }
  [[nodiscard]] double all_rows() const;
  /// The cost above which a pose is a bad one.
  [[nodiscard]] double limit(Eigen::Index rows) const {
    return static_cast<double>(rows) * std::log(all_rows()) + 2 * std::log(poses());
  }
  [[nodiscard]] Fitting begun(const Alternative& alternative) const;
  void linearise(const Alternative& alternative, Fitting& fitting) const;
  [[nodiscard]] Eigen::VectorXd step(const Alternative& alternative, double farthest,
                                     Fitting& fitting) const;
  [[nodiscard]] Fit judged(const Alternative& alternative, const Fitting& fitting) const;
  /// Measured - predicted in B (m; rad), and minus its derivative; rows(pose) of both.
  void residual(const Alternative& alternative, const Eigen::VectorXd& values, int pose,
                Eigen::VectorXd& r, Eigen::MatrixXd& jacobian) const;
  [[nodiscard]] Eigen::MatrixXd prior_precision(const Alternative& alternative,
                                                const Eigen::VectorXd& scale) const;

  const CompensatedModel& model_;
  const MeasurementBatch& batch_;
  Eigen::Matrix3Xd bias_B_;                 // m
  std::vector<Matrix3> rotation_bias_B_;    // of each pose
  Eigen::Matrix<double, 6, -1> deviation_;  // m, rad
  std::vector<bool> is_turned_;             // true: its orientation is judged
  std::vector<PoseContext> contexts_;
};

}  // namespace trammel::batch_triage
