#pragma once

#include <vector>

#include "server/measurement/measurement.h"

namespace trammel {

/// The rows of `batch` in at most eight blocks of poses that are neighbours in joint space, rows of
/// one joint vector together. The rows of a block rise; no block is empty.
[[nodiscard]] std::vector<std::vector<std::size_t>> joint_blocks(const MeasurementBatch& batch);

}  // namespace trammel
