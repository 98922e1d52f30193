#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "server/base/result.h"

namespace trammel {

struct DiagnoseOptions {
  std::uint64_t seed = 1;
  int draws =
      400;  ///< batches simulated with nothing to find, from which the line of a finding is taken
  int next_poses = 10;  ///< to suggest where causes cannot be told apart; 0: none
  bool recovery =
      true;  ///< measure how large effects must be to be named (the recovery curves of the page)
  /// Is told the present step, and the share done of all in [0, 1]; return false to give up.
  std::function<bool(const std::string& stage, double share)> progress;
};

/// Added to the seed, so that no two draws of one diagnosis repeat each other. The line of a
/// finding adds nothing.
inline constexpr std::uint64_t kNamingDraw = 1;
inline constexpr std::uint64_t kRecoveryDraw = 2;

/// Tells `options.progress` what is being done. Busy where it gives up.
[[nodiscard]] Status report_progress(const DiagnoseOptions& options, const std::string& stage,
                                     double share);

}  // namespace trammel
