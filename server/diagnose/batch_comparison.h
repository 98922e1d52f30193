#pragma once

#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/diagnose/diagnosis.h"

/// How triage() fits one explanation of a batch; the model is at the head of triage.cpp.
namespace trammel::batch_triage {

constexpr int kFewOutliers = 2;  ///< more than these may be a step

/// An explanation: which parameters of which model are free, from which pose on.
struct Alternative {
  Cause cause;  ///< `cause` empty: none
  bool harmful = false;
  bool tracker_elsewhere = false;
  int first = 0;
  PhysicalModel model;
  std::vector<bool> free;  ///< of the model's parameters: by this alternative, from pose `first` on
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
};

struct Fitting;

/// The batch against one model: what the alternatives share.
class Comparison {
 public:
  Comparison(const CompensatedModel& model, const MeasurementBatch& batch) : model_(model), batch_(batch) {
    const CompensatedModel::LevelErrors errors = model.errors_B(batch);
    bias_B_ = errors.calibrated - errors.compensated;
    deviation_ = errors.stddev;
    const double expected = std::sqrt(deviation_.squaredNorm() / static_cast<double>(poses()));
    if (const auto& held_out = model.parts().validation) {
      deviation_ *= std::max(1.0, held_out->compensated.rms / expected);
    }
    for (const Measurement& m : batch.measurements) contexts_.push_back(as_served(m));
  }

  [[nodiscard]] int poses() const { return static_cast<int>(batch_.measurements.size()); }
  [[nodiscard]] const MeasurementBatch& batch() const { return batch_; }
  [[nodiscard]] const CompensatedModel& model() const { return model_; }

  [[nodiscard]] Fit fit(const Alternative& alternative) const;
  /// Where the base would have to stand for the batch as it is; where it stands in `model` when that cannot be told.
  [[nodiscard]] Pose located_base(const PhysicalModel& model) const;

 private:
  [[nodiscard]] PoseContext as_served(const Measurement& m) const {
    PoseContext context = m.context;
    context.served = true;
    if (!context.temperature) context.temperature = model_.parts().temperature_mean;
    return context;
  }
  /// What a pose may cost before it is a bad one.
  [[nodiscard]] double limit() const { return 3 * std::log(3.0 * poses()) + 2 * std::log(poses()); }
  [[nodiscard]] Fitting begun(const Alternative& alternative) const;
  void linearise(const Alternative& alternative, Fitting& fitting) const;
  [[nodiscard]] Eigen::VectorXd step(const Alternative& alternative, double farthest, Fitting& fitting) const;
  [[nodiscard]] Fit judged(const Alternative& alternative, const Fitting& fitting) const;
  /// Measured - predicted, and minus its derivative.
  void residual(const Alternative& alternative, const Eigen::VectorXd& values, int pose, Vector3& r,
                Eigen::MatrixXd& jacobian) const;
  [[nodiscard]] Eigen::MatrixXd prior_precision(const Alternative& alternative, const Eigen::VectorXd& scale) const;

  const CompensatedModel& model_;
  const MeasurementBatch& batch_;
  Eigen::Matrix3Xd bias_B_, deviation_;  // m
  std::vector<PoseContext> contexts_;
};

}  // namespace trammel::batch_triage
