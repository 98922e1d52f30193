#pragma once

#include <vector>

#include "server/measurement/measurement.h"

/// Set-ups of the instrument within one batch.
namespace trammel {

/// True if the batch has more than one session.
[[nodiscard]] bool has_sessions(const MeasurementBatch& batch);

/// Divides the batch by the session ids of its rows: the rows of one stand together and keep their
/// order, the sessions are ordered by when they began where all have Unix times, else as they first
/// come (and the batch has no clock). Rows without an id are a session that has the batch's name.
/// One id is one session: such a batch stays as it is.
void divide_into_sessions(MeasurementBatch& batch);

/// The sessions as batches of their own, in their order: each has the id of its session. Indices
/// and rows stay.
[[nodiscard]] std::vector<MeasurementBatch> by_session(const MeasurementBatch& batch);

/// Without the sessions whose flag is false; those left keep their order. One that is left alone is
/// a whole batch.
[[nodiscard]] MeasurementBatch only_sessions(const MeasurementBatch& batch,
                                             const std::vector<bool>& kept);

}  // namespace trammel
