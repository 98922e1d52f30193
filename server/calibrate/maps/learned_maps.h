#pragma once

#include <map>

#include "server/calibrate/calibration.h"
#include "server/error_sources/joint_map.h"

namespace trammel {

inline constexpr int kMostHarmonics = 150;  ///< of a joint: waves of 2.4 degrees

/// The most probable spectra of maps of these joints (0-based) beside what was identified `without`
/// them, from the same batch; each map with as many harmonics as the poses can tell and the data
/// gain by, no more than `most`. Together they leave room for the other parameters in a model.
[[nodiscard]] std::map<int, MapSpectrum> learned_maps(const CalibrationResult& without,
                                                      const MeasurementBatch& batch,
                                                      const std::vector<int>& joints,
                                                      int most = kMostHarmonics);

}  // namespace trammel
