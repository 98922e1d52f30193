#include "server/compensate/known_rows.h"

namespace trammel {

bool knows(const CompensatedModel& model, const Measurement& m) {
  return resolve_tool(model.cell(), m.context.tool) && resolve_payload(model.cell(), m.context.payload) &&
         model.check_trained_with(m.context.tool, m.context.payload);
}

MeasurementBatch known_rows(const CompensatedModel& model, const MeasurementBatch& batch) {
  MeasurementBatch known = batch;
  std::erase_if(known.measurements, [&](const Measurement& m) { return !knows(model, m); });
  return known;
}

}  // namespace trammel
