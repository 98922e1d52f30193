#pragma once

#include <string>
#include <vector>

namespace trammel {

/// A cause that was tried in addition to those before it in the list.
struct TriedCause {
  std::vector<std::string> sources;  ///< spelled as in a list: `joint_map:2`
  double held_out_before = 0;        ///< m, rms of left-out positions, with the causes before it
  double held_out_after = 0;         ///< m, held-out error with this cause
  double gain = 0;     ///< nat: the rise of the log likelihood by this cause, beside the ones taken
                       ///< before
  double freedom = 0;  ///< the number of its parameters that the batch determines
  bool taken = false;
  std::string why;  ///< for people, one clause

  /// The poses do not show the cause; the held-out error with it was not computed.
  [[nodiscard]] bool not_shown() const { return !taken && held_out_after == held_out_before; }
};

/// The causes that a training with `error_sources: auto` tried, in the order of the trials: first
/// loads with the compliances that they act on, then by falling gain.
struct CauseChoice {
  double held_out = 0;  ///< m, with all that was taken
  std::vector<TriedCause> tried;
};

}  // namespace trammel
