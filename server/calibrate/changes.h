#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"

/// Finds changes of the arm between two sessions of one batch.
namespace trammel {

/// A cause that began between two sessions and lasts since.
struct Change {
  std::string source;       ///< as a list of error sources has it: `joint_slip:3@121`
  std::size_t session = 0;  ///< from which on, its place in CalibrationResult::sessions
  double gain = 0;          ///< twice the log likelihood that it adds, everything else refitted
  double p_value =
      1;  ///< chance that the best of all candidates at all boundaries gains as much with no change
  std::vector<std::string> could_also_be = {};  ///< explain it nearly as well: `tool_changed@121`
  /// The rate of a joint's zero that wanders instead, rad from session to session, a random walk;
  /// 0: it changed once.
  double rate = 0;
  std::vector<std::string> steps =
      {};  ///< of a wandering zero: its sources, one for each session but the first

  /// The error sources that it adds to a model's list.
  [[nodiscard]] std::vector<std::string> sources() const {
    return steps.empty() ? std::vector{source} : steps;
  }
};

/// The change that the sessions speak for most: a joint that lost its zero, another tool, another
/// load, from a session on; empty where none is beyond chance. `found` was identified on `batch`,
/// whose sessions each have a base of their own. Every candidate is held against the residuals with
/// everything else free (a score test), so nothing is fitted again. What the model leaves over is
/// no white noise: it makes differences between sessions of other poses, too. How much is measured
/// by the same candidates between halves of each session's poses, where nothing can have changed,
/// and taken off. Of four sessions and more it is also asked whether the zero of a joint wanders;
/// that is taken where it explains more than any single change.
[[nodiscard]] std::optional<Change> strongest_change(const CalibrationResult& found,
                                                     const MeasurementBatch& batch);

/// A change, with no session taken to be noisier than the others: what looks like a noisy session
/// may be a change. Empty where none is noisier. It is only a proposal, since a session that is
/// noisy looks like a change as well.
[[nodiscard]] std::optional<Change> change_instead_of_noise(const CalibrationResult& found,
                                                            const MeasurementBatch& batch);

}  // namespace trammel
