#pragma once

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Some sources of a calibrated model, identified anew; everything else stays bit for bit.
struct Refit {
  /// The whole model. In its covariance, what was kept is as uncertain as before; what is anew is
  /// as uncertain as the new poses and the rest leave it. Suspects, rms and discrepancy are of the
  /// new poses.
  CalibrationResult result;
  std::vector<Eigen::Index> place;  ///< of each parameter of the model before, in `result`
  std::vector<Eigen::Index> anew;   ///< R, of those identified anew
  Eigen::VectorXd prior_variance;   ///< P, SI: prior variances
  Eigen::MatrixXd given_rest;       ///< R x R, SI: covariance of what is anew, were the rest exact
  Eigen::MatrixXd by_rest;          ///< R x P, SI: how an error of the rest changes what is anew

  /// The covariance that `before`, of the parameters of the model before, turns into (Schmidt's
  /// consider covariance). That of the rest stays; by_rest carries it into what is anew, and
  /// given_rest is added there.
  [[nodiscard]] Eigen::MatrixXd carried(const Eigen::MatrixXd& before) const;
};

/// Identifies the sources in `only` anew on `batch`, and leaves all others as in `known`: for a
/// tracker that was set up again or a tool that was changed. Sources start at their priors, base
/// and tool where the poses put them; those that the model has not are added. Of tools and payloads
/// only those in `batch` are anew. `cell` has the nominal frames of what is anew, and may have more
/// tools and payloads than the cell of `known`. Refuses what calibrate() refuses, frames in `only`
/// that the poses do not determine, and a cell without a tool or payload of `known`.
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
