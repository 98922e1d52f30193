#include "server/compensate/known_rows.h"

#include <algorithm>

namespace trammel {

bool knows(const CompensatedModel& model, const Measurement& m) {
  return resolve_tool(model.cell(), m.context.tool) &&
         resolve_payload(model.cell(), m.context.payload) &&
         model.check_trained_with(m.context.tool, m.context.payload);
}

LearnedFrom::LearnedFrom(const CompensatedModel& model, const std::string& hash) {
  const ModelProvenance& from = model.provenance();
  is_its_batch_ = hash == from.batch_hash ||
                  std::any_of(from.refits.begin(), from.refits.end(),
                              [&](const RefitRecord& refit) { return hash == refit.batch_hash; });
  if (!model.parts().bias) return;
  for (const auto& q : model.parts().bias->q.rowwise()) joints_.emplace(q.begin(), q.end());
}

bool LearnedFrom::operator()(const Measurement& m) const {
  const JointVector& q = m.context.q;
  return (is_its_batch_ && m.set != MeasurementSet::kValidation) ||
         joints_.contains({q.begin(), q.end()});
}

MeasurementBatch known_rows(const CompensatedModel& model, const MeasurementBatch& batch) {
  MeasurementBatch known = batch;
  std::erase_if(known.measurements, [&](const Measurement& m) { return !knows(model, m); });
  return known;
}

}  // namespace trammel
