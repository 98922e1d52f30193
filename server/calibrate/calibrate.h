#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// A model to start from and the measurements to explain. Unknown base and tools are found first.
struct CalibrationProblem {
  PhysicalModel model;
  MeasurementBatch batch;  ///< checked against the cell
};

struct CalibrateOptions {
  int max_iterations = 100;
};

struct IdentifiedParameter {
  Parameter parameter;
  double value = 0;         ///< SI
  double stddev = 0;        ///< SI, of the posterior
  bool identified = false;  ///< false: more than half of the prior's standard deviation is left
};

/// A direction in parameter space that the data do not show (singular value below 1 in prior units).
struct UnidentifiableCombination {
  double singular_value = 0;
  std::vector<std::string> parameters;  ///< those that matter in it, largest first
  std::string sentence;                 ///< for people
};

struct CalibrationResult {
  PhysicalModel model;  ///< with identified values
  std::vector<IdentifiedParameter> parameters;
  Eigen::MatrixXd covariance;  ///< P x P, SI
  int rank = 0;                ///< directions with singular value >= 1
  std::vector<UnidentifiableCombination> unidentifiable;
  double condition_number = 0;      ///< of the identified directions, prior units
  double log_likelihood = 0;        ///< nat, of the residuals under sigma and discrepancy
  double rms = 0;                   ///< m, Euclidean residual of the training positions
  double discrepancy = 0;           ///< m per axis: what the model leaves over beyond the measurement's sigma
  double discrepancy_rotation = 0;  ///< rad per axis
  bool converged = false;
  int iterations = 0;
  std::string message;  ///< of the solver
};

/// Identifies the parameters of the model's sources by maximum a posteriori (Gaussian priors in the parameters' own
/// scales, residuals in units of sigma), source section 3.3.2. Orientation errors are rotation vectors. Where the model
/// cannot reach the measurement's sigma, the surplus is estimated as a discrepancy and added to it, so that positions
/// and orientations, good and bad points keep their proper weights. Refuses: fewer equations than identifiable
/// parameters; a base or tool that the data cannot determine.
[[nodiscard]] Result<CalibrationResult> calibrate(const CalibrationProblem& problem, const CalibrateOptions& options);

/// Calibrates `cell` with the sources that `specs` name. Where a cause has several forms, the one under which the data
/// are likeliest is kept (all have the same number of parameters).
[[nodiscard]] Result<CalibrationResult> calibrate(const std::shared_ptr<const Cell>& cell,
                                                  const std::vector<std::string>& specs, const MeasurementBatch& batch,
                                                  const CalibrateOptions& options);

}  // namespace trammel
