#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/measurement/checked_batch.h"

/// Which error sources of one training the next one keeps.
namespace trammel {

/// The sources that are valid beyond the batch: without those that begin at one of its poses, and
/// without effects of the tracker.
[[nodiscard]] std::vector<std::string> lasting_sources(const std::vector<std::string>& sources);

/// The sources that `model` was trained with, where a cause with several forms is spelled as in
/// `cell`. Sources of one batch are included only if `batch` is the one that the model was trained
/// from.
[[nodiscard]] std::vector<std::string> sources_in_force(const CompensatedModel& model,
                                                        const Cell& cell,
                                                        const CheckedBatch& batch);

/// The cell's own list plus the additional sources of the model in force, which an applied
/// diagnosis or a user's level added. So gains are kept, except for sources that need a temperature
/// which is constant in `batch`. Empty if there is no additional source.
[[nodiscard]] std::optional<std::string> level_with_additions(const Cell& cell,
                                                              const CompensatedModel& in_force,
                                                              const MeasurementBatch& batch);

}  // namespace trammel
