#include "server/compensate/stated_coverage.h"

#include "server/base/coverage.h"
#include "server/measurement/gauges.h"

namespace trammel {

double stated_coverage(const CompensatedModel& model, const MeasurementBatch& batch) {
  Eigen::Index inside = 0, all = 0;
  const auto count = [&](const auto& errors, const Measurement& m) {
    const double sigma = m.sigma.value_or(model.cell().tracker.sigma);
    inside += (errors.array().abs() <= kInterval95 * sigma).count();
    all += errors.size();
  };
  const MeasurementBatch positions = positions_of(batch);
  if (!positions.measurements.empty()) {
    const CompensatedModel::LevelErrors errors = model.errors_B(positions);
    for (Eigen::Index i = 0; i < errors.compensated.cols(); ++i)
      count(errors.compensated.col(i), positions.measurements[static_cast<std::size_t>(i)]);
  }
  if (has_gauges(batch)) {
    const CompensatedModel::GaugeErrors errors = model.gauge_errors(batch);
    for (std::size_t i = 0; i < errors.rows.size(); ++i)
      count(errors.compensated.segment<1>(static_cast<Eigen::Index>(i)), batch.measurements[errors.rows[i]]);
  }
  return all > 0 ? static_cast<double>(inside) / static_cast<double>(all) : 0;
}

}  // namespace trammel
