#include "server/tasks/train/drawing_doubted.h"

#include <algorithm>
#include <vector>

#include "server/calibrate/calibrate.h"
#include "server/compensate/file_doubts.h"
#include "server/error_sources/spelling.h"

namespace trammel {

namespace {

/// The sources of `physics`, and the standard ones that it lacks.
std::vector<std::string> with_standard_sources(const PhysicalModel& physics) {
  std::vector<std::string> sources;
  for (const ErrorSourcePtr& source : physics.sources) sources.push_back(source->name());
  for (const std::string& standard : standard_sources()) {
    const bool is_there =
        std::any_of(sources.begin(), sources.end(),
                    [&](const std::string& source) { return are_forms_of_one(source, standard); });
    if (!is_there) sources.push_back(standard);
  }
  return sources;
}

}  // namespace

std::optional<std::string> drawing_doubted(const PhysicalModel& physics,
                                           const MeasurementBatch& rows) {
  if (identifies_geometry(physics)) return std::nullopt;
  const Result<CalibrationResult> found =
      calibrate(physics.cell, with_standard_sources(physics), rows, {});
  if (!found) return std::nullopt;
  for (const auto& doubt : {robot_off_drawing(found->model, found->parameters, found->discrepancy),
                            base_elsewhere(found->model),
                            lengths_scaled(found->model, found->parameters, found->covariance)})
    if (doubt && doubt->severity == Note::Severity::kStop) return doubt->text;
  return std::nullopt;
}

}  // namespace trammel
