#include "server/calibrate/batch_check.h"

#include <utility>

#include "server/calibrate/gauges/gauge_doubt.h"
#include "server/calibrate/orientation_check.h"
#include "server/measurement/gauges.h"
#include "server/measurement/reading_doubt.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

/// The batch as a robot has its joints whose zeros are where the positions say.
MeasurementBatch with_zeros(MeasurementBatch batch, const JointVector& zeros) {
  for (Measurement& m : batch.measurements) m.context.q += zeros;
  return batch;
}

/// Of the first session that has one: each was measured in a world of its own. `positions` says
/// what speaks against its positions.
template <typename Positions>
std::optional<Error> doubt_of_sessions(const MeasurementBatch& batch, const Cell& cell,
                                       const Positions& positions) {
  for (const MeasurementBatch& session : by_session(positions_of(batch))) {
    if (session.measurements.empty()) continue;
    const ReadingLook seen = look_at_readings(session, cell);
    if (std::optional<Error> doubt = positions(seen)) return doubt;
    if (auto doubt = orientation_doubt(with_zeros(session, seen.zeros), cell, seen.X_WB))
      return doubt;
  }
  return std::nullopt;
}

}  // namespace

std::optional<Error> batch_doubt(const MeasurementBatch& batch, const Cell& cell) {
  if (auto doubt =
          doubt_of_sessions(batch, cell, [](const ReadingLook& seen) { return seen.doubt; }))
    return doubt;
  return has_gauges(batch) ? gauge_doubt(batch, cell) : std::nullopt;
}

std::optional<Error> reading_doubt(const MeasurementBatch& batch, const Cell& cell) {
  return doubt_of_sessions(batch, cell, [](const ReadingLook& seen) {
    return seen.of_tool ? std::optional<Error>() : seen.doubt;
  });
}

Status check_batch(const MeasurementBatch& batch, const Cell& cell) {
  std::optional<Error> doubt = batch_doubt(batch, cell);
  if (!doubt) return {};
  return Failure(std::move(*doubt)).in("batch " + batch.id);
}

}  // namespace trammel
