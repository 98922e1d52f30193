#include "server/calibrate/batch_check.h"

#include <utility>

#include "server/calibrate/orientation_check.h"
#include "server/measurement/reading_doubt.h"

namespace trammel {

namespace {

/// The batch as a robot has its joints whose zeros are where the positions say.
MeasurementBatch with_zeros(MeasurementBatch batch, const JointVector& zeros) {
  for (Measurement& m : batch.measurements) m.context.q += zeros;
  return batch;
}

}  // namespace

std::optional<Error> batch_doubt(const MeasurementBatch& batch, const Cell& cell) {
  ReadingLook seen = look_at_readings(batch, cell);
  if (seen.doubt) return std::move(seen.doubt);
  return orientation_doubt(with_zeros(batch, seen.zeros), cell, seen.X_WB);
}

std::optional<Error> reading_doubt(const MeasurementBatch& batch, const Cell& cell) {
  ReadingLook seen = look_at_readings(batch, cell);
  if (seen.doubt && !seen.of_tool) return std::move(seen.doubt);
  return orientation_doubt(with_zeros(batch, seen.zeros), cell, seen.X_WB);
}

Status check_batch(const MeasurementBatch& batch, const Cell& cell) {
  std::optional<Error> doubt = batch_doubt(batch, cell);
  if (!doubt) return {};
  return Failure(std::move(*doubt)).in("batch " + batch.id);
}

}  // namespace trammel
