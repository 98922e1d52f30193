#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/measurement/checked_batch.h"

/// Which error sources of one training the next one keeps.
namespace trammel {

/// The sources that hold beyond the batch: without those that begin at one of its poses, and
/// without what the tracker did meanwhile.
[[nodiscard]] std::vector<std::string> lasting_sources(const std::vector<std::string>& sources);

/// The sources that `model` was trained with, a cause of several forms as `cell` lists it; those of
/// one batch only where it is `batch` that the model was trained from.
[[nodiscard]] std::vector<std::string> sources_in_force(const CompensatedModel& model,
                                                        const Cell& cell,
                                                        const CheckedBatch& batch);

/// The cell's own list and what the model in force has besides, as an applied diagnosis or
/// somebody's level put it there: what was won stays won, but for what goes with a temperature that
/// is the same in all of `batch`. Empty where there is nothing besides.
[[nodiscard]] std::optional<std::string> level_with_additions(const Cell& cell,
                                                              const CompensatedModel& in_force,
                                                              const MeasurementBatch& batch);

}  // namespace trammel
