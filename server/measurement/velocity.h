#pragma once

#include "server/measurement/measurement.h"

namespace trammel {

/// Fills PoseContext::velocity of every measurement from its neighbours in time, or clears it if
/// the batch is not one continuous path. A continuous path has at least 3 measurements, each with a
/// time, strictly increasing. No step is longer than 1 s or than 3 times the median step, and no
/// joint moves by more than 0.2 rad (m) in a step. (A robot that stops to be measured needs seconds
/// per pose, so batches of single poses have no velocity.) The velocity is the slope of the
/// parabola through three neighbouring poses: at its middle pose, and at the ends of the path at
/// the end pose. For equal steps that is the central difference. Exact for constant acceleration.
/// Returns whether velocities were filled.
bool fill_velocity(MeasurementBatch& batch);

}  // namespace trammel
