#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/calibrate/identify/identifiability.h"
#include "server/calibrate/sessions/session_setting.h"
#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

/// The question to a calibration, and its result.
namespace trammel {

/// If the joints belong to the positions, identification leaves less than the larger of two limits:
/// this one (m rms), and a share of the spread of the positions. A nominal robot is off by a few
/// mm.
inline constexpr double kNoModelError = 0.025;
inline constexpr double kNoModelShare = 0.05;

/// A model to start from, and the measurements to explain. An unknown base and unknown tools are
/// found first.
struct CalibrationProblem {
  PhysicalModel model;
  MeasurementBatch batch;  ///< checked against the cell
  bool stretched = false;  ///< each session but the newest has a scale of its own
};

struct CalibrateOptions {
  int max_iterations = 100;
  std::vector<bool> held;    ///< a flag for each parameter that stays as it is; empty: none
  bool weigh_links = false;  ///< the data may add `self_weight` to `compliance` if the files have
                             ///< no link masses
  bool robust = true;  ///< Huber loss beyond the residual that 1 in 1000 good poses exceeds, so a
                       ///< bad pose has little influence
};

/// A pose whose residual is far above its sigma.
struct SuspectPose {
  std::string pose_id;
  int row = 0;          ///< in its file
  double distance = 0;  ///< m, of the position
  double sigmas = 0;    ///< the distance over the expected standard deviation of one axis
};

struct IdentifiedParameter {
  Parameter parameter;
  double value = 0;         ///< SI
  double stddev = 0;        ///< SI, of the posterior
  bool identified = false;  ///< true if less than half of the prior standard deviation is left
};

struct CalibrationResult {
  PhysicalModel model;  ///< with identified values
  std::vector<IdentifiedParameter> parameters;
  Eigen::MatrixXd covariance;  ///< P x P, SI
  /// P x P, in [-1, 1].
  [[nodiscard]] Eigen::MatrixXd correlation() const;
  int rank = 0;  ///< directions with singular value >= 1
  std::vector<UnidentifiableCombination> unidentifiable;
  double condition_number = 0;  ///< of the identified directions, prior units
  double log_likelihood = 0;    ///< nat, of the residuals under sigma and discrepancy
  double log_evidence =
      0;  ///< nat: the same with the parameters integrated over their priors (Laplace)
  double rms =
      0;  ///< m, Euclidean residual of the training positions; of gauges alone: of their values
  double discrepancy = 0;  ///< m per axis: the model's error beyond the measurement's sigma
  double discrepancy_rotation = 0;  ///< rad per axis
  double discrepancy_of_pose =
      0;  ///< m per axis: the part of it that all positions at one joint vector share
  /// m per axis: the discrepancy with which each of `together` positions at one joint vector is
  /// weighted, beside its own sigma. As far as these share the arm's error, they weigh as one pose.
  [[nodiscard]] double discrepancy_of_one(int together) const;
  /// Geometric mean of the identified singular values over sqrt(poses) (Borm and Menq 1991).
  double observability_index = 0;
  std::vector<SuspectPose> suspects;  ///< farthest first
  /// The settings of the sessions of a batch, the newest last. aligned() uses them to move the
  /// measurements into the world of the model. Empty: one session.
  std::vector<SessionSetting> sessions;
  std::vector<double>
      cost_record;  ///< half the weighted sum of squares, of all iterations in their order
  bool converged = false;
  int iterations = 0;
  std::string message;  ///< of the solver
};

}  // namespace trammel
