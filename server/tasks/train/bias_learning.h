#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "server/compensate/compensated_model.h"
#include "server/tasks/train/left_out.h"

namespace trammel {

/// Learns the bias of `kernel` or, for `auto`, the best one, from the residuals of the physics of
/// `parts` on `all`, and puts it into `parts`. `left_out`: of `all`, without suspects. `progress`:
/// the share done; false gives up.
[[nodiscard]] Status add_bias(CompensatedModel::Parts& parts, const MeasurementBatch& all,
                              const std::string& kernel, const LeftOut& left_out,
                              std::uint64_t seed,
                              const std::function<bool(double share)>& progress);

}  // namespace trammel
