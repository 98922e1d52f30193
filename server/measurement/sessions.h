#pragma once

#include <vector>

#include "server/measurement/measurement.h"

/// Set-ups of the instrument within one batch.
namespace trammel {

/// True if the batch has more than one session.
[[nodiscard]] bool has_sessions(const MeasurementBatch& batch);

/// Groups the rows of the batch by their session ids; rows of a session keep their order. If all
/// rows have Unix times, sessions are ordered by their start. Otherwise they stay in the order of
/// their first rows, and the batch has no clock. Rows without an id form a session with the batch's
/// name. With a single id the batch is one session and stays unchanged.
void divide_into_sessions(MeasurementBatch& batch);

/// The sessions as batches of their own, in their order: each has the id of its session. Indices
/// and rows stay.
[[nodiscard]] std::vector<MeasurementBatch> by_session(const MeasurementBatch& batch);

/// The batch without the sessions whose flag is false; the others keep their order. A single
/// remaining session becomes a whole batch.
[[nodiscard]] MeasurementBatch only_sessions(const MeasurementBatch& batch,
                                             const std::vector<bool>& kept);

}  // namespace trammel
