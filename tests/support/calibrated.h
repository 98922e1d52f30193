#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"

namespace trammel::test {

/// The identified parameter with that name; the test fails if there is none.
inline const IdentifiedParameter& parameter(const CalibrationResult& result,
                                            const std::string& name) {
  const auto found =
      std::find_if(result.parameters.begin(), result.parameters.end(),
                   [&](const IdentifiedParameter& p) { return p.parameter.name == name; });
  EXPECT_NE(found, result.parameters.end()) << name;
  return *found;
}

/// Rms of the position errors that the model leaves in a batch, mm.
inline double held_out_mm(const CalibrationResult& result, const MeasurementBatch& batch) {
  double sum = 0;
  for (const Measurement& m : batch.measurements)
    sum += (m.p_W - result.model.pose_W(m.context).translation()).squaredNorm();
  return to_mm(std::sqrt(sum / static_cast<double>(batch.measurements.size())));
}

}  // namespace trammel::test
