#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/calibrate/calibration.h"

/// The residuals of a model, and the sigmas that measurements are therefore weighed with.
namespace trammel {

/// Standard deviations of the model's own error, added to the measurement's in quadrature.
struct Weights {
  double discrepancy = 0;           ///< m per axis
  double discrepancy_rotation = 0;  ///< rad per axis
  bool estimated = false;           ///< false: not yet, the measurement's sigma counts alone
  double of_pose = 0;  ///< m per axis: the part of the discrepancy that positions at one joint
                       ///< vector share

  std::vector<int> together = {};  ///< of each row of the batch: counted_together()

  /// m per axis: the discrepancy with which `m`, row `row` of the batch, is weighted beside its own
  /// sigma. A gauge that is read against another pose has twice the variance. Positions at one
  /// joint vector weigh as one pose, as far as they share the error.
  [[nodiscard]] double beside(const Measurement& m, std::size_t row) const;
  /// m per axis: the error of `m` alone beside its own sigma. It is less than beside() if the row
  /// shares its error with others.
  [[nodiscard]] double beside_alone(const Measurement& m) const;
};
/// The weights under which `found` was found, for the rows of `batch`.
[[nodiscard]] Weights weights_of(const CalibrationResult& found, const MeasurementBatch& batch);

/// Standard deviation of one axis of the measured position, or of the gauge, m: the measurement's
/// own if it has one, otherwise the tracker's.
[[nodiscard]] double position_sigma(const Measurement& m, const Cell& cell);
/// Standard deviation of one axis of the measured orientation, rad: likewise.
[[nodiscard]] double rotation_sigma(const Measurement& m, const Cell& cell);

/// The number of poses whose model error enters: 1, or 2 for a gauge that is read against another
/// pose or measured from it.
[[nodiscard]] double gauged_poses(const Measurement& m);

/// Measured - predicted in W, SI. Without gauges column i is of measurement i. A contact stands
/// among the positions, because it gives three numbers of one point.
struct Residuals {
  Eigen::Matrix3Xd position;  ///< 3 x N, of the measurements with a position, and of contacts
  Eigen::Matrix3Xd rotation;  ///< 3 x M, rotation vectors of the poses that have an orientation
  Eigen::VectorXd sigma;      ///< N, of the measured positions
  Eigen::VectorXd sigma_rotation;  ///< M, of the measured orientations
  std::vector<Eigen::Index> positions,
      gauges;             ///< which measurement each is of; empty gauges: all have positions
  Eigen::VectorXd gauge;  ///< G, m
  Eigen::VectorXd sigma_gauge, poses_of_gauge;  ///< G: standard deviations; gauged_poses()
  /// Groups of columns of `position` at one joint vector. Empty if there are no groups, or if
  /// columns_together() was not called.
  std::vector<std::vector<Eigen::Index>> together;

  /// m: rms of the Euclidean residuals of the positions; without positions, of the gauges.
  [[nodiscard]] double rms() const;
};

/// At the parameter `values` instead of the model's own.
[[nodiscard]] Residuals residuals_of(const PhysicalModel& model, const MeasurementBatch& batch,
                                     const Eigen::VectorXd& values);

/// Residuals::together of residuals that have none yet.
[[nodiscard]] std::vector<std::vector<Eigen::Index>> columns_together(const MeasurementBatch& batch,
                                                                      const Residuals& r);

/// The number of parameters that each kind of residual decides, not counting what the priors
/// decide.
struct Freedom {
  double positions = 0;  ///< and gauges
  double turns = 0;
  double means = 0;  ///< fitted to the means of the positions at one joint vector
};

/// The discrepancies under which the residuals have their expected size after these parameters were
/// fitted. `drop_suspects`: leaves out positions that are suspects under `before`.
[[nodiscard]] Weights estimated_weights(const Residuals& r, const Freedom& freedom,
                                        const Weights& before, bool drop_suspects);
/// True if measurements of `tracker` have nearly the same sigmas under both.
[[nodiscard]] bool are_settled(const Weights& now, const Weights& before, const Tracker& tracker);

/// The deviation of each measurement: 1 is as far off as 1 in 10^6 good ones.
[[nodiscard]] Eigen::VectorXd farness_of(const MeasurementBatch& batch, const Residuals& r,
                                         const Weights& weights);
/// The deviation of each measurement, those with a position first.
[[nodiscard]] std::vector<SuspectPose> off_by(const MeasurementBatch& batch, const Residuals& r,
                                              const Weights& weights);
/// Poses that lie farther off than 1 in 10^6 good ones would, farthest first.
[[nodiscard]] std::vector<SuspectPose> suspects_of(const MeasurementBatch& batch,
                                                   const Residuals& r, const Weights& weights);

/// Nat. A suspect counts as if it were just at the limit: one bad pose is no proof against a model.
[[nodiscard]] double log_likelihood(const Residuals& r, const Weights& weights);

}  // namespace trammel
