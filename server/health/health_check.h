#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"
#include "server/health/drift.h"
#include "server/health/foreign_poses.h"
#include "server/measurement/checked_batch.h"
#include "server/plan/check_design.h"

/// Whether a robot still is the one that its model was trained on, by a few poses.
namespace trammel {

enum class HealthVerdict {
  kHealthy,    ///< as the model has it, and no change above the tolerance could be hidden
  kChanged,    ///< beyond chance
  kCannotTell  ///< these poses could hide a change above the tolerance, or it may be chance
};
/// `healthy`, `changed`, `cannot_tell`.
[[nodiscard]] std::string_view to_string(HealthVerdict verdict);

/// Where a cell file says nothing.
inline constexpr double kUsualTolerance = 1e-4;  // m

struct HealthOptions {
  double tolerance = kUsualTolerance;  ///< m, of an effect over the working poses, rms
  bool new_tool = false;               ///< the tool sits elsewhere than in the model: it is refitted with the base
  double false_alarm = 0.003;          ///< chance that a healthy robot is said to have changed
  double power = 0.95;                 ///< chance with which an effect of the stated smallest size is seen
  std::uint64_t seed = 1;
  std::vector<DriftSeen> earlier = {};  ///< what checks before this one saw of the arm's drift
};

/// A zero that a joint lost.
struct LostZero {
  int joint = 0;   ///< 0-based
  double by = 0;   ///< rad
  double u95 = 0;  ///< rad, U(k=2)
};

/// A change that was seen.
struct SeenChange {
  SingleCause cause;              ///< `unknown`: no single cause fits; a lost zero of no joint: those of several
  double effect_rms = 0;          ///< m, base (and tool) refitted, over the working poses
  double u95 = 0;                 ///< m, U(k=2) of it
  bool at_these_poses = false;    ///< `effect_rms` is at the check's: they do not show how large it is elsewhere
  std::vector<LostZero> zeros{};  ///< of lost zeros: which, and by how much
  double p_value = 1;             ///< chance that the best of all causes explains as much in a healthy robot
  std::vector<SingleCause> could_also_be = {};
};

struct HealthCheck {
  HealthVerdict verdict = HealthVerdict::kCannotTell;
  std::string sentence;  ///< why, for people
  int poses = 0;
  double tolerance = 0;                   ///< m
  double rms = 0;                         ///< m, Euclidean, base (and tool) refitted, suspect poses left out
  double expected_rms = 0;                ///< m, of a healthy robot
  double p_value = 1;                     ///< chance of at least as much in a healthy robot
  std::optional<double> would_have_seen;  ///< m: the largest of `smallest`; empty where an effect would not be seen
  std::vector<SmallestEffect> smallest;   ///< the largest first
  std::vector<SeenChange> changed;
  std::vector<std::string> suspects;  ///< pose ids that fit nothing, left out
  std::vector<CauseNotAsked> not_asked;
  std::string model;                    ///< id of the one that it was held against
  std::optional<DriftSeen> drift;       ///< what this check says of it; empty: nothing
  std::optional<DriftRate> drift_rate;  ///< by this check and the earlier ones
  std::string due;                      ///< date of the next check (ISO 8601, UTC); empty: cannot be said
  std::string due_because;              ///< from what that follows, or why it cannot be said
};

/// Holds `batch` against `model`. The tracker may stand anywhere: the base is found anew. Poses whose tool or payload
/// the model was not trained with do not count; a batch that has no other is refused.
/// So is one of several set-ups, and one that was not read as it was meant (reading_doubt()), unless lost zeros explain
/// all of its poses. Where the poses are off by more than 5 mm only lost zeros and a tool that sits elsewhere are
/// named; else nothing can be told.
///
/// The residuals of all poses are r = B b (+ T t) + J theta + e with e ~ N(0, S): S has the measurement's noise, what
/// the parameters leave uncertain, and what the model leaves over, which poses near each other share; it is scaled so
/// that the model's own held-out poses have the size that they had. Each single cause is tested beside base (and tool),
/// and everything together. The limit on their p-values is the one that the smallest of them stays above in
/// 1 - `false_alarm` of simulated healthy checks at these very poses.
///
/// Where a check is beyond that limit, zeros that several joints lost at once are tried first, with or without a tool
/// that sits elsewhere; then single causes, one after the other. An error of any form over a joint's angle is named
/// only where it leaves nothing beyond chance. Causes that explain as much as a named one stand beside it.
[[nodiscard]] Result<HealthCheck> check_health(const CompensatedModel& model, const CheckedBatch& batch,
                                               const HealthOptions& options);

}  // namespace trammel
