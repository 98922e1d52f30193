#pragma once

#include "server/calibrate/refit.h"
#include "server/compensate/compensated_model.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

/// A model whose named sources were identified anew, before a bias is learned anew for it.
struct Refitted {
  CompensatedModel::Parts parts;  ///< without figures of the new poses
  MeasurementBatch poses;  ///< as they were met: what began at a pose of another batch has happened
  CalibrationResult found;  ///< of `poses`; its covariance is of what was identified anew alone
};

/// `from` with the sources in `only` identified anew on `trained`, the rows of `batch` that are not
/// held out, repeats merged; the bias, which lives in B, explains its share of them first. All else
/// stays bit for bit: values and their covariance, frames, bias, domain, temperature and the record
/// of the training. `cell` may have more tools and payloads. Refuses what refit() and
/// check_may_start_from() refuse.
[[nodiscard]] Result<Refitted> refitted(const CompensatedModel& from,
                                        const std::shared_ptr<const Cell>& cell,
                                        const CheckedBatch& batch, const MeasurementBatch& trained,
                                        const std::vector<std::string>& only);

/// Refuses a robot that is another one; a frame in `cell` that is not the model's and is not named;
/// a tool of `batch` (checked against `cell`) that nobody knows.
[[nodiscard]] Status check_may_start_from(const CompensatedModel& from, const Cell& cell,
                                          const MeasurementBatch& batch,
                                          const std::vector<std::string>& only);

/// `cell` with the tools of `from` that it says nothing of itself and that are not to be found
/// anew.
[[nodiscard]] Cell with_known_tools(Cell cell, const CompensatedModel& from,
                                    const std::vector<std::string>& only);

}  // namespace trammel
