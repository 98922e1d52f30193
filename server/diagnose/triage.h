#pragma once

#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/diagnose/diagnosis.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

enum class TriageVerdict {
  kClean,      ///< as the model expects it
  kExplained,  ///< not, and `cause` says why
  kPoisoned    ///< not, and nothing known explains it
};
/// `clean`, `explained`, `poisoned`.
[[nodiscard]] std::string_view to_string(TriageVerdict verdict);

/// The verdict of a new batch on a model, before anything is learned from it.
struct Triage {
  TriageVerdict verdict = TriageVerdict::kClean;
  bool learn = true;  ///< false: keep the batch apart until somebody who knows has looked at it
  /// The cause of kExplained: `tracker_moved`, `tool_changed`, `payload_changed`, `joint_slip`,
  /// `outlier`, or `drift`, which is the arm itself; with the pose at which it began where that is
  /// not the first.
  Cause cause;
  bool tracker_elsewhere = false;     ///< besides `cause`, the tracker or the base stands elsewhere
  std::vector<Cause> could_also_be;   ///< explain it as well
  std::vector<std::string> outliers;  ///< pose ids that nothing makes fit the others
  double misfit = 0, misfit_after = 0;  ///< rms residual over its expected deviation: of all poses;
                                        ///< explained, without the outliers
  double effect_rms = 0;                ///< m, Euclidean, of what the cause does to the poses
  double effect_rotation_rms = 0;  ///< rad, of the orientations likewise; 0 where none are judged
  std::string sentence;            ///< for people
};

/// Holds the rows of `batch` that `model` knows() against it and tells apart: a tracker or base
/// that stands elsewhere, another tool, another payload, a joint that lost its zero, single bad
/// poses, an arm that has changed, each from the beginning of the batch or from one of its poses
/// on. Orientations are judged like positions where the model was trained on some. Numbers that
/// were read wrongly (reading_doubt()) are poison, and the reading that would fit is named. With
/// fewer than 8 poses nothing else is said: clean.
[[nodiscard]] Triage triage(const CompensatedModel& model, const CheckedBatch& batch);

/// triage() where tools and base are to be those of `cell`, which may say others than the model's.
[[nodiscard]] Triage triage(const CompensatedModel& model, const CheckedBatch& batch,
                            const Cell& cell);

}  // namespace trammel
