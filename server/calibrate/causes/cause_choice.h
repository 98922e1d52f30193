#pragma once

#include <string>
#include <vector>

namespace trammel {

/// A cause that was tried beside those before it in the list.
struct TriedCause {
  std::vector<std::string> sources;  ///< as they are spelled: `joint_map:2`
  double held_out_before =
      0;                      ///< m, rms of positions that were left out, with the causes before it
  double held_out_after = 0;  ///< m, the same with this cause
  double gain = 0;     ///< nat: how much likelier the batch is with it, beside those taken before
  double freedom = 0;  ///< how many of its numbers the batch tells
  bool taken = false;
  std::string why;  ///< for people, one clause

  /// The poses do not show it; how far blocks are missed with it was not asked.
  [[nodiscard]] bool not_shown() const { return !taken && held_out_after == held_out_before; }
};

/// The causes that a training with `error_sources: auto` tried, in their order: loads and what
/// gives way under them, then the largest gain first.
struct CauseChoice {
  double held_out = 0;  ///< m, with all that was taken
  std::vector<TriedCause> tried;
};

}  // namespace trammel
