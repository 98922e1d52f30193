#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "server/diagnose/diagnosis.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

struct DiagnoseOptions {
  std::uint64_t seed = 1;
  int draws = 400;       ///< of the null, for the 99 % line
  int next_poses = 10;   ///< to suggest where causes are confounded; 0: none
  bool recovery = true;  ///< measure how large effects must be (the injection curve of the page)
  /// What is being done and the share done of all in [0, 1]; return false to give up.
  std::function<bool(const std::string& stage, double share)> progress;
};

/// Shows what `cell`'s error sources do not explain of the training rows of `batch` (checked against it), names the
/// causes that do, and says what cannot be told. Refuses what calibrate() does and orientations that do not follow the
/// joints. Same batch, cell and seed, same diagnosis.
[[nodiscard]] Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                                         const DiagnoseOptions& options);

}  // namespace trammel
