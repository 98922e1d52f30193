#pragma once

#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/diagnose/diagnosis.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

enum class TriageVerdict {
  kClean,      ///< the batch is as the model expects
  kExplained,  ///< not, and `cause` says why
  kPoisoned    ///< the batch differs, and no known cause explains it
};
/// `clean`, `explained`, `poisoned`.
[[nodiscard]] std::string_view to_string(TriageVerdict verdict);

/// The verdict on a new batch against a model, before anything is learned from it.
struct Triage {
  TriageVerdict verdict = TriageVerdict::kClean;
  bool learn = true;  ///< false: keep the batch apart until an expert has looked at it
  /// The cause of kExplained: `tracker_moved`, `tool_changed`, `payload_changed`, `joint_slip`,
  /// `outlier`, or `drift` (the arm itself); with the pose at which it began unless that is the
  /// first.
  Cause cause;
  bool tracker_elsewhere = false;     ///< besides `cause`, the tracker or the base stands elsewhere
  std::vector<Cause> could_also_be;   ///< explain it as well
  std::vector<std::string> outliers;  ///< pose ids that nothing makes fit the others
  double misfit = 0, misfit_after = 0;  ///< rms residual over its expected deviation: of all poses;
                                        ///< explained, without the outliers
  double effect_rms = 0;                ///< m, Euclidean: the effect of the cause on the poses
  double effect_rotation_rms = 0;  ///< rad, of the orientations likewise; 0 where none are judged
  std::string sentence;            ///< for people
};

/// Tests the rows of `batch` that `model` knows() against it and distinguishes: a tracker or base
/// that stands elsewhere, another tool, another payload, a joint that lost its zero, single bad
/// poses, and an arm that has changed. Each may begin with the batch or at one of its poses.
/// Orientations are judged like positions if the model was trained on some. Misread numbers
/// (reading_doubt()) make the batch unusable, and the reading that would fit is named. With fewer
/// than 8 poses the answer is always: clean.
[[nodiscard]] Triage triage(const CompensatedModel& model, const CheckedBatch& batch);

/// triage() with the tools and the base of `cell`, which may differ from the model's.
[[nodiscard]] Triage triage(const CompensatedModel& model, const CheckedBatch& batch,
                            const Cell& cell);

}  // namespace trammel
