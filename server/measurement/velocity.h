#pragma once

#include "server/measurement/measurement.h"

namespace trammel {

/// Fills PoseContext::velocity of every measurement from its neighbours in time, and clears it where the rule is not
/// met. The rule: at least 3 measurements, a time in each, strictly increasing, and the batch is one continuous path:
/// no step longer than 1 s or than 3 times the median step, and no joint moves by more than 0.2 rad (m) in a step. (A
/// robot that stands still to be measured needs seconds a pose, so batches of single poses keep no velocity.) The
/// velocity is the derivative at the middle of the parabola through three neighbouring poses, which is the central
/// difference where steps are equal; at both ends the parabola's slope there. Exact for constant acceleration. True
/// when filled.
bool fill_velocity(MeasurementBatch& batch);

}  // namespace trammel
