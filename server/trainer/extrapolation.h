#pragma once

#include "server/calibrate/calibrate.h"

namespace trammel {

/// How fast what the physics leaves over of the measured positions grows beyond the poses of `batch`: n numbers, m of
/// one coordinate's standard deviation by rad (m) of a joint out of range, see Domain::growth(). Learned from the
/// batch: for each joint and either end, the third of its range there is left out, the parameters are identified on the
/// rest (to first order about `found`, which knows all; where its covariance is 0 they stay), and the poses left out
/// are asked; what they miss by beyond the rest's own residual and the parameters' uncertainty is growth. The worse end
/// counts. A joint that hardly moved takes the largest of the others. Suspects are not asked.
[[nodiscard]] JointVector extrapolation_slope(const CalibrationResult& found, const MeasurementBatch& batch);

}  // namespace trammel
