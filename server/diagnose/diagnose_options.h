#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// A proof by effects put into the batch's own residuals. It goes in rounds, one diagnosis a cause.
struct ProveOptions {
  /// Asked before each round and, by the thread that would do it, before each diagnosis: false once
  /// the time is over. `round` counts from 0.
  std::function<bool(int round)> has_time;
  /// Calls `work(i)` for each i below `count`, in any order, and ends when all are done.
  std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)> for_each;
};

struct DiagnoseOptions {
  std::uint64_t seed = 1;
  int draws =
      400;  ///< batches simulated with nothing to find, from which the line of a finding is taken
  int next_poses = 10;  ///< to suggest where causes cannot be told apart; 0: none
  bool recovery =
      true;  ///< measure how large effects must be to be named (the recovery curves of the page)
  /// Is told the present step, and the share done of all in [0, 1]; return false to give up.
  std::function<bool(const std::string& stage, double share)> progress;
  /// Proves how large effects must be, in the batch's own residuals; stands for `recovery`.
  std::optional<ProveOptions> prove = {};
};

/// Added to the seed, so that no two draws of one diagnosis repeat each other. The line of a
/// finding adds nothing.
inline constexpr std::uint64_t kNamingDraw = 1;
inline constexpr std::uint64_t kRecoveryDraw = 2;
inline constexpr std::uint64_t kProofDraw = 3;

/// Tells `options.progress` what is being done. Busy where it gives up.
[[nodiscard]] Status report_progress(const DiagnoseOptions& options, const std::string& stage,
                                     double share);

}  // namespace trammel
