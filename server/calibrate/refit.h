#pragma once

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Some sources of a calibrated model identified anew; everything else is what it was, bit for bit.
struct Refit {
  /// The whole model. Its covariance holds what was kept as it was known before, what was identified anew with what the
  /// poses and the rest leave uncertain of it; suspects, rms and discrepancy are of the new poses.
  CalibrationResult result;
  std::vector<Eigen::Index> place;  ///< of each parameter known before, among those of `result`
  std::vector<Eigen::Index> anew;   ///< R, of those identified anew
  Eigen::VectorXd prior_variance;   ///< P, SI: of parameters that came with the cell and nothing told; else 0
  Eigen::MatrixXd given_rest;       ///< R x R, SI: covariance of what is anew if all the rest were exact
  Eigen::MatrixXd by_rest;          ///< R x P, SI: what an error of the rest does to it

  /// What `before`, a covariance of the parameters known before, has become: (Schmidt's consider covariance) that of
  /// the rest stays, by_rest carries it into what is anew, given_rest is added there.
  [[nodiscard]] Eigen::MatrixXd carried(const Eigen::MatrixXd& before) const;
};

/// Identifies the sources in `only` anew on `batch` (the tracker was set up again, the tool was changed), and leaves
/// all others at what `known` says. They start at their priors, base and tool where the poses put them by the arm as it
/// is known, and are added where the model has none. Of tools and payloads only those that `batch` has are anew. `cell`
/// says the nominal frames of what is anew and may have more tools and payloads than that of `known`. Refuses what
/// calibrate() refuses, frames in `only` that the poses do not tell, and a cell that lacks a tool or payload of
/// `known`.
[[nodiscard]] Result<Refit> refit(const CalibrationResult& known, const std::shared_ptr<const Cell>& cell,
                                  const MeasurementBatch& batch, const std::vector<std::string>& only,
                                  CalibrateOptions options = {});

/// `model` in `cell`, which may have more tools and payloads: their parameters are at their priors. `place`, where
/// given, receives where each of the model's parameters went. Refuses a cell that lacks one of them.
[[nodiscard]] Result<PhysicalModel> in_cell(const PhysicalModel& model, const std::shared_ptr<const Cell>& cell,
                                            std::vector<Eigen::Index>* place = nullptr);

}  // namespace trammel
