#pragma once

#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// A batch in the world that the model's base stands in.
struct InWorld {
  MeasurementBatch batch;                 ///< one session
  std::vector<std::string> located = {};  ///< sessions placed by their own rows for this model
};

/// Moves each session of `batch` (checked against the model's cell) into the world of the model. If
/// the model knows the session and the rows fit it, it uses the place found in training. Otherwise,
/// if the batch has several sessions, it uses the place where the rows fit the model best. Poses of
/// known sessions are placed in time, so that a change that came later does not act on them. A
/// batch of one unknown session counts as measured in the model's world. Refuses a session whose
/// rows do not determine the place of its instrument. Refuses gauges of several sessions, and
/// gauges to an anchor with an unknown place.
[[nodiscard]] Result<InWorld> in_world_of(const CompensatedModel& model,
                                          const MeasurementBatch& batch);

}  // namespace trammel
