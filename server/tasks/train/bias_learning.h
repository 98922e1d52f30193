#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "server/compensate/compensated_model.h"
#include "server/tasks/train/left_out.h"

namespace trammel {

/// Learns the bias of `kernel` or, for `auto`, the one that is worth it from what the physics of
/// `parts` leaves over of `all`, and puts it into `parts`. `left_out`: of `all`, without suspects.
/// `progress`: the share done; false gives up.
[[nodiscard]] Status add_bias(CompensatedModel::Parts& parts, const MeasurementBatch& all,
                              const std::string& kernel, const LeftOut& left_out,
                              std::uint64_t seed,
                              const std::function<bool(double share)>& progress);

}  // namespace trammel
