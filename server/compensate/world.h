#pragma once

#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// A batch in the world that the model's base stands in.
struct InWorld {
  MeasurementBatch batch;  ///< one session
  std::vector<std::string> located =
      {};  ///< sessions that stand where their own rows put them for this model
};

/// Moves each session of `batch` (checked against the model's cell) into the world of the model:
/// where the model knows the session and the rows fit it, as it was found in training; else, where
/// the batch has several, as its own rows fit the model best. Poses of sessions that the model
/// knows are placed in time, so that a change that came later does not count for them. A batch of
/// one session that the model does not know was measured in that world. Refuses a session whose
/// rows do not tell where its instrument stood, and gauges of several sessions or to an anchor
/// whose place nobody knows.
[[nodiscard]] Result<InWorld> in_world_of(const CompensatedModel& model,
                                          const MeasurementBatch& batch);

}  // namespace trammel
