#pragma once

#include "server/calibrate/refit.h"
#include "server/compensate/compensated_model.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

/// A model with its named sources identified anew, before its bias is learned anew.
struct Refitted {
  CompensatedModel::Parts parts;  ///< without figures of the new poses
  MeasurementBatch poses;   ///< the poses as the sources saw them: changes at a pose of another
                            ///< batch have happened
  CalibrationResult found;  ///< of `poses`; its covariance covers only the parameters identified
                            ///< anew
};

/// `from` with the sources in `only` identified anew on `trained`, the rows of `batch` that are not
/// held out, repeats merged. The bias, which is expressed in B, is subtracted first. All else stays
/// bit for bit: values and their covariance, frames, bias, domain, temperature and the record of
/// the training. `cell` may have more tools and payloads. Refuses the same as refit() and
/// check_may_start_from().
[[nodiscard]] Result<Refitted> refitted(const CompensatedModel& from,
                                        const std::shared_ptr<const Cell>& cell,
                                        const CheckedBatch& batch, const MeasurementBatch& trained,
                                        const std::vector<std::string>& only);

/// Refuses another robot; a frame in `cell` that differs from the model's and is not listed; and a
/// tool of `batch` (checked against `cell`) that neither cell nor model knows.
[[nodiscard]] Status check_may_start_from(const CompensatedModel& from, const Cell& cell,
                                          const MeasurementBatch& batch,
                                          const std::vector<std::string>& only);

/// `cell` with the tools of `from` that it leaves open and that are not to be identified anew.
[[nodiscard]] Cell with_known_tools(Cell cell, const CompensatedModel& from,
                                    const std::vector<std::string>& only);

}  // namespace trammel
