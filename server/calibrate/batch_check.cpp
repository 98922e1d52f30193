#include "server/calibrate/batch_check.h"

#include <utility>

#include "server/calibrate/gauges/gauge_doubt.h"
#include "server/calibrate/orientation_check.h"
#include "server/measurement/computed_positions.h"
#include "server/measurement/gauges.h"
#include "server/measurement/reading_doubt.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

/// The batch with its joints corrected by the zeros that the positions suggest.
MeasurementBatch with_zeros(MeasurementBatch batch, const JointVector& zeros) {
  for (Measurement& m : batch.measurements) m.context.q += zeros;
  return batch;
}

/// The doubt of the first session that has one, since each session has its own world frame.
/// `positions` judges the positions of one session.
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

/// The doubt that positions were computed from the drawing. A model in force would take them for a
/// change of its arm.
std::optional<Error> computed_doubt(double off_drawing, const MeasurementBatch& batch,
                                    const Cell& cell) {
  if (off_drawing < 0) return std::nullopt;
  const auto computed = computed_not_measured(off_drawing, cell.tracker.sigma,
                                              static_cast<int>(batch.measurements.size()));
  if (!computed) return std::nullopt;
  return refused("{}", *computed)
      .of("x_mm,y_mm,z_mm")
      .with_text("computed")
      .next("are they the controller's own? Only measured positions tell anything of the arm")
      .value();
}

}  // namespace

std::optional<Error> batch_doubt(const MeasurementBatch& batch, const Cell& cell) {
  if (auto doubt =
          doubt_of_sessions(batch, cell, [](const ReadingLook& seen) { return seen.doubt; }))
    return doubt;
  return has_gauges(batch) ? gauge_doubt(batch, cell) : std::nullopt;
}

std::optional<Error> reading_doubt(const MeasurementBatch& batch, const Cell& cell) {
  return doubt_of_sessions(batch, cell, [&](const ReadingLook& seen) {
    if (seen.doubt && !seen.of_tool) return seen.doubt;
    return computed_doubt(seen.off_drawing, batch, cell);
  });
}

Status check_batch(const MeasurementBatch& batch, const Cell& cell) {
  std::optional<Error> doubt = batch_doubt(batch, cell);
  if (!doubt) return {};
  return Failure(std::move(*doubt)).in("batch " + batch.id);
}

}  // namespace trammel
