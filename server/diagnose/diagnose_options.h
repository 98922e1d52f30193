#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// A proof that adds effects to the batch's own residuals. Each round makes one diagnosis per
/// cause.
struct ProveOptions {
  /// Called before each round and, by the working thread, before each diagnosis. Returns false once
  /// the time is over. `round` counts from 0.
  std::function<bool(int round)> has_time;
  /// Calls `work(i)` for each i below `count`, in any order. Returns when all are done.
  std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)> for_each;
};

struct DiagnoseOptions {
  std::uint64_t seed = 1;
  int draws =
      400;  ///< batches simulated with nothing to find, from which the line of a finding is taken
  int next_poses = 10;  ///< poses to suggest if causes cannot be distinguished; 0: none
  bool recovery =
      true;  ///< measure how large effects must be to be named (the recovery curves of the page)
  /// Is told the present step, and the share done of all in [0, 1]; return false to give up.
  std::function<bool(const std::string& stage, double share)> progress;
  /// Proves in the batch's own residuals how large effects must be. It replaces `recovery`.
  std::optional<ProveOptions> prove = {};
};

/// Added to the seed, so that no two draws of one diagnosis repeat each other. The draw for the
/// threshold of a finding adds nothing.
inline constexpr std::uint64_t kNamingDraw = 1;
inline constexpr std::uint64_t kRecoveryDraw = 2;
inline constexpr std::uint64_t kProofDraw = 3;

/// Reports the current step to `options.progress`. Busy if it gives up.
[[nodiscard]] Status report_progress(const DiagnoseOptions& options, const std::string& stage,
                                     double share);

}  // namespace trammel
