#include "server/health/foreign_poses.h"

#include <algorithm>
#include <vector>

#include "server/base/median.h"
#include "server/base/units.h"
#include "server/calibrate/batch_check.h"
#include "server/compensate/known_rows.h"
#include "server/measurement/gauges.h"

namespace trammel {

namespace {

double median_length(const Eigen::Matrix3Xd& vectors) {
  std::vector<double> lengths;
  for (const auto& one : vectors.colwise()) lengths.push_back(one.norm());
  return median(std::move(lengths));
}

}  // namespace

std::optional<std::string> foreign_poses(const CompensatedModel& model,
                                         const MeasurementBatch& batch) {
  const MeasurementBatch known = known_rows(model, positions_of(batch));
  if (known.measurements.empty()) return std::nullopt;
  const CompensatedModel::LevelErrors errors = model.errors_B(known);
  const double off = median_length(errors.compensated), expected = median_length(errors.stddev);
  if (!(off > kNeverOff && off > kNeverExpected * expected)) return std::nullopt;
  const std::optional<Error> doubt = reading_doubt(known, model.cell());
  return fmt::format(
      "these poses do not fit the model: half of them are off by {:.1f} mm or more, it expects "
      "{:.2g} mm; {}",
      to_mm(off), to_mm(expected),
      doubt ? sentence(*doubt)
            : "are they targets instead of measurements, are rows or columns (x_mm and y_mm, two "
              "joints) exchanged, is a unit or a sign another one, was the instrument moved, or is "
              "it another robot?");
}

}  // namespace trammel
