#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/compensate/held_back.h"
#include "server/compensate/paired_gain.h"
#include "server/compensate/served_model.h"
#include "server/tasks/accept/judging.h"

/// The decision whether a new model takes the place of the one in force by itself.
///
/// The model: in a session s the tracker sees p = X_WB(s) (f(q) + e(q)) + noise, f the prediction
/// in B and e the true error of the model at that pose. X_WB(s) is found for each model from the
/// session's training rows, so what is left on its judging rows is e and noise, and the pose by
/// pose difference of two models' squared errors has no share of the noise itself. What cannot be
/// told: an e that a shift or a turn of the whole arm takes away; e at poses, tools and payloads
/// that no judge has. There the one in force stays.
///
/// The one in force stays unless the candidate is better beyond chance, or better both on the
/// judges and by what the two say of themselves. Equally good models therefore change nothing, and
/// many small losses cannot add up.
namespace trammel {

/// The conditions for a new model to be put in force.
enum class Bar {
  kBetter,  ///< better on the judges: beyond chance, or as the models' own uncertainties say, too
  kBetterBeyondChance  ///< PairedGain::beyond_chance() alone
};

struct GateOptions {
  Bar bar = Bar::kBetter;
  static constexpr double kUsualAcceptRatio = 1.02;
  double accept_ratio = kUsualAcceptRatio;  ///< rms over that of any model that has served, on the
                                            ///< same judges, at the most
  static constexpr int kFewestJudges = 30;  ///< poses, in the joint ranges of the model in force
  static constexpr double kLeastCoverage =
      0.5;  ///< of those ranges: by judges, and by a model trained anew
  static constexpr double kClaimedGain =
      0.9;  ///< own uncertainty over that of the one in force, at the most
  static constexpr double kSame = 1e-6;  ///< m rms: nearer to each other two models are the same
};

struct GateQuestion {
  const CompensatedModel& candidate;
  /// None: the candidate is the first model of its cell. Version 0: the model that the candidate
  /// extends.
  const ServedModel* in_force = nullptr;
  std::vector<ServedModel>
      served_before;  ///< the candidate must not be worse than any of them either
  std::vector<JudgingSession> sessions;  ///< oldest first
  std::size_t first_new = 0;  ///< from this one on they came after the model in force was trained
};

/// The errors that the two leave at the same judges, m rms; empty where they were not held against
/// each other.
struct GateFigures {
  std::optional<double> before;  ///< of the one in force; of a first model, nominal
  std::optional<double> after;   ///< of the candidate
  std::optional<double> limit;   ///< what `after` had to be below
};

struct GateVerdict {
  bool put_in_force = false;
  std::string message;  ///< before, after, limit and why
  bool undecided =
      false;  ///< not enough to judge by: nothing speaks against the candidate, a person decides
  std::string why = {};  ///< of the message: the reason alone
  GateFigures figures = {};
  HeldBack held_back = HeldBack::kNo;  ///< also where the judges found it not better
};

/// True if `after` is worse by more than chance explains, however few the judges are: half as much
/// again (rms of the same poses).
[[nodiscard]] constexpr bool is_far_worse(double before, double after) {
  return after > 1.5 * before;
}

[[nodiscard]] GateVerdict judge(const GateQuestion& question, const GateOptions& options);

/// The sessions that speak about today's arm. Where one of the models knows of a dated change, only
/// what was measured since counts. Else by the model in force. A session is strange where its
/// median judge is twice as far off as that model expects. Where the newest ones are strange and
/// came after the model, the arm has changed: only they count. Else a strange session counts
/// nothing and, where it was there before the model was trained, neither do those before it: they
/// are of an arm that was.
[[nodiscard]] std::vector<JudgingSession> sessions_of_today(const GateQuestion& question);

}  // namespace trammel
