#pragma once

#include <map>

#include "server/calibrate/calibration.h"
#include "server/error_sources/joint_map.h"

namespace trammel {

inline constexpr int kMostHarmonics = 150;  ///< of a joint: waves of 2.4 degrees

/// The most probable spectra for maps of these joints (0-based), learned from the batch on which
/// `without` was identified. Each map has as many harmonics as the poses determine and the data
/// gain by, at most `most`. All maps together leave room for the other parameters of a model.
[[nodiscard]] std::map<int, MapSpectrum> learned_maps(const CalibrationResult& without,
                                                      const MeasurementBatch& batch,
                                                      const std::vector<int>& joints,
                                                      int most = kMostHarmonics);

}  // namespace trammel
