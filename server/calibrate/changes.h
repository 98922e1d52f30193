#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"

/// Finds changes of the arm between two sessions of one batch.
namespace trammel {

/// A cause that began between two sessions and lasts since.
struct Change {
  std::string source;       ///< in the spelling of a list of error sources: `joint_slip:3@121`
  std::size_t session = 0;  ///< from which on, its place in CalibrationResult::sessions
  double gain = 0;  ///< the increase of twice the log likelihood, with everything else refitted
  double p_value =
      1;  ///< chance of such a gain by the best candidate at any boundary without a change
  std::vector<std::string> could_also_be = {};  ///< explain it nearly as well: `tool_changed@121`
  /// The rate of a joint's zero that wanders instead, rad from session to session, a random walk;
  /// 0: it changed once.
  double rate = 0;
  std::vector<std::string> steps =
      {};  ///< for a wandering zero: its sources, one for each session except the first

  /// The error sources that it adds to a model's list.
  [[nodiscard]] std::vector<std::string> sources() const {
    return steps.empty() ? std::vector{source} : steps;
  }
};

/// The most strongly supported change from a session on: a joint that lost its zero, another tool,
/// or another load. Empty if no change is beyond chance. `found` was identified on `batch`, whose
/// sessions each have a base of their own. Each candidate is tested against the residuals with all
/// other parameters free (a score test), so nothing is fitted again. The model error is not white
/// noise, so it also makes differences between sessions with different poses. The same candidates
/// between halves of each session's poses, where nothing can have changed, measure its size, which
/// is then subtracted. With four or more sessions, a wandering joint zero is a candidate as well.
/// It is chosen if it explains more than every single change.
[[nodiscard]] std::optional<Change> strongest_change(const CalibrationResult& found,
                                                     const MeasurementBatch& batch);

/// The strongest change if no session is assumed noisier than the others, since an apparently noisy
/// session may be a change. Empty if no session is noisier. The result is a proposal only, because
/// a noisy session also looks like a change.
[[nodiscard]] std::optional<Change> change_instead_of_noise(const CalibrationResult& found,
                                                            const MeasurementBatch& batch);

}  // namespace trammel
