#pragma once

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Some sources of a calibrated model, identified anew; everything else stays bit for bit.
struct Refit {
  /// The whole model. In its covariance, kept parameters are as uncertain as before; new parameters
  /// have the uncertainty that the new poses and the kept ones leave them. Suspects, rms and
  /// discrepancy are those of the new poses.
  CalibrationResult result;
  std::vector<Eigen::Index> place;  ///< of each parameter of the model before, in `result`
  std::vector<Eigen::Index> anew;   ///< R, indices of the parameters identified anew
  Eigen::VectorXd prior_variance;   ///< P, SI: prior variances
  Eigen::MatrixXd given_rest;  ///< R x R, SI: covariance of the new parameters if the kept ones
                               ///< were exact
  Eigen::MatrixXd by_rest;  ///< R x P, SI: the effect of an error of the kept parameters on the new
                            ///< ones

  /// Carries `before`, the covariance of the former model's parameters, over to the new model
  /// (Schmidt's consider covariance). The part of the kept parameters stays; by_rest carries it
  /// into the new parameters, where given_rest is added.
  [[nodiscard]] Eigen::MatrixXd carried(const Eigen::MatrixXd& before) const;
};

/// Identifies the sources in `only` anew on `batch` and leaves all others as in `known`, for a
/// tracker that was set up again or a tool that was changed. Sources start at their priors, and
/// base and tool where the poses place them; sources that the model lacks are added. Only tools and
/// payloads in `batch` are identified anew. `cell` has the nominal frames of the new parts, and may
/// have more tools and payloads than the cell of `known`. Refuses in the cases of calibrate().
/// Refuses also frames in `only` that the poses do not determine, and a cell that lacks a tool or
/// payload of `known`.
[[nodiscard]] Result<Refit> refit(const CalibrationResult& known,
                                  const std::shared_ptr<const Cell>& cell,
                                  const MeasurementBatch& batch,
                                  const std::vector<std::string>& only,
                                  CalibrateOptions options = {});

/// `model` in `cell`, which may have more tools and payloads; their parameters are at the priors.
/// `place`, where given, receives the new index of each parameter of the model. Refuses a cell
/// without one of the model's tools or payloads.
[[nodiscard]] Result<PhysicalModel> in_cell(const PhysicalModel& model,
                                            const std::shared_ptr<const Cell>& cell,
                                            std::vector<Eigen::Index>* place = nullptr);

}  // namespace trammel
