#include "server/calibrate/calibrate_with_maps.h"

#include <algorithm>

#include "server/calibrate/maps/learned_maps.h"

namespace trammel {

Result<CalibrationResult> calibrate_with_maps(const std::shared_ptr<const Cell>& cell,
                                              const std::vector<std::string>& specs,
                                              const MeasurementBatch& batch,
                                              const CalibrateOptions& options) {
  // Refuses specs that are wrong or given twice, in their written form.
  TRY(make_physical_model(cell, specs));
  std::vector<std::string> all = spelled_out(specs, *cell);
  std::vector<std::string> others;
  std::vector<int> joints;
  for (const std::string& spec : all) {
    if (const std::optional<int> joint = joint_of_open_map(spec)) {
      joints.push_back(*joint);
    } else {
      others.push_back(spec);
    }
  }
  if (joints.empty()) return calibrate(cell, specs, batch, options);
  const Result<CalibrationResult> without = calibrate(cell, others, batch, options);
  if (!without) return without;
  const std::map<int, MapSpectrum> learned = learned_maps(*without, batch, joints);
  for (std::string& spec : all) {
    if (const std::optional<int> joint = joint_of_open_map(spec))
      spec = spelled_map(*joint, learned.at(*joint));
  }
  return calibrate(cell, all, batch, options);
}

}  // namespace trammel
