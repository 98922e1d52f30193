#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/health/drift.h"
#include "server/plan/check_design.h"

/// The question to a check of a robot, and its result.
namespace trammel {

enum class HealthVerdict {
  kHealthy,    ///< unchanged; a change above the tolerance could not be hidden
  kChanged,    ///< beyond chance
  kCannotTell  ///< these poses could hide a change above the tolerance, or it may be chance
};
/// `healthy`, `changed`, `cannot_tell`.
[[nodiscard]] std::string_view to_string(HealthVerdict verdict);

/// The default if a cell file states none.
inline constexpr double kUsualTolerance = 1e-4;  // m

/// s: a robot is checked that often, as long as no checks tell how fast it drifts.
inline constexpr std::int64_t kUsualInterval = 30 * 86400;

struct HealthOptions {
  double tolerance = kUsualTolerance;  ///< m, of an effect over the working poses, rms
  bool new_tool =
      false;  ///< the tool sits elsewhere than in the model: it is refitted with the base
  double false_alarm = 0.003;  ///< chance that the verdict on a healthy robot is a change
  double power = 0.95;         ///< chance with which an effect of the stated smallest size is seen
  std::uint64_t seed = 1;
  std::vector<DriftSeen> earlier = {};  ///< the arm's drift by earlier checks
};

/// A zero that a joint lost.
struct LostZero {
  int joint = 0;          ///< 0-based
  double by = 0;          ///< rad
  double u95 = 0;         ///< rad, U(k=2)
  double effect_rms = 0;  ///< m: the effect of this zero alone; set where the change's effect is
                          ///< known
  double effect_u95 = 0;  ///< m, U(k=2) of the effect
};

/// A change that was seen.
struct SeenChange {
  SingleCause
      cause;  ///< `unknown`: no single cause fits; a lost zero of no joint: those of several
  double effect_rms = 0;  ///< m, base (and tool) refitted, over the working poses
  double u95 = 0;         ///< m, U(k=2) of the effect
  bool at_these_poses =
      false;  ///< `effect_rms` is at the check's poses, which do not show its size elsewhere
  std::vector<LostZero> zeros{};  ///< for lost zeros: the joints and the sizes
  double p_value = 1;  ///< chance that the best cause explains as much in a healthy robot
  std::vector<SingleCause> could_also_be = {};
};

/// A pose of a check against the model.
struct PoseAtCheck {
  std::string pose_id;
  Vector3 place_B = Vector3::Zero();  ///< m, as the model predicts it
  Vector3 off_B = Vector3::Zero();    ///< m: measured - predicted, base (and tool) refitted
  double expected = 0;                ///< m, rms of |off_B| of a healthy robot
  bool suspect = false;               ///< it fits nothing, and was left out
};

struct HealthCheck {
  HealthVerdict verdict = HealthVerdict::kCannotTell;
  std::string sentence;  ///< why, for people
  int poses = 0;
  double tolerance = 0;     ///< m
  double rms = 0;           ///< m, Euclidean, base (and tool) refitted, suspect poses left out
  double expected_rms = 0;  ///< m, of a healthy robot
  double p_value = 1;       ///< chance of at least as much in a healthy robot
  std::optional<double>
      would_have_seen;  ///< m: the largest of `smallest`; empty where an effect would not be seen
  std::vector<SmallestEffect> smallest;  ///< the largest first
  std::vector<SeenChange> changed;
  std::vector<PoseAtCheck> at_poses = {};  ///< in the order of the batch
  std::vector<std::string> suspects;       ///< pose ids that fit nothing, left out
  std::vector<CauseNotAsked> not_asked;
  std::string model;                    ///< id of the one that it was held against
  std::optional<DriftSeen> drift;       ///< the drift by this check; empty: it shows none
  std::optional<DriftRate> drift_rate;  ///< by this check and the earlier ones
  std::string due;  ///< date of the next check (ISO 8601, UTC): by the drift, or kUsualInterval
                    ///< later while too few checks show it; empty: it changed, or times are unknown
  std::string due_because;  ///< the basis of the date, or the reason why there is none
};

}  // namespace trammel
