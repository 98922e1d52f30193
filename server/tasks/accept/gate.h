#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/compensate/held_back.h"
#include "server/compensate/paired_gain.h"
#include "server/compensate/served_model.h"
#include "server/tasks/accept/judging.h"

/// Decides whether a new model replaces the one in force automatically.
///
/// The model: in a session s the tracker sees p = X_WB(s) (f(q) + e(q)) + noise, where f is the
/// prediction in B and e the true error of the model at that pose. X_WB(s) is located for each
/// model from the session's training rows, so the residuals of its judging rows are e and noise. In
/// the pose by pose difference of two models' squared errors the square of the noise cancels. Two
/// kinds of error cannot be seen: an e that a shift or a turn of the whole arm removes, and e at
/// poses, tools and payloads without judging rows. In these cases the model in force stays.
///
/// The model in force stays unless the candidate is better beyond chance, or is better both on the
/// judging rows and by the stated uncertainties. So equally good models change nothing, and many
/// small losses cannot accumulate.
namespace trammel {

/// The conditions for a new model to be put in force.
enum class Bar {
  kBetter,  ///< better on the judges: beyond chance, or also according to the models' own
            ///< uncertainties
  kBetterBeyondChance  ///< PairedGain::beyond_chance() alone
};

struct GateOptions {
  Bar bar = Bar::kBetter;
  static constexpr double kUsualAcceptRatio = 1.02;
  double accept_ratio = kUsualAcceptRatio;  ///< largest rms relative to that of any model that has
                                            ///< served, on the same judging rows
  static constexpr int kFewestJudges = 30;  ///< poses, in the joint ranges of the model in force
  static constexpr double kLeastCoverage =
      0.5;  ///< of those ranges: by judging rows, and by a model trained anew
  static constexpr double kClaimedGain =
      0.9;  ///< largest own uncertainty relative to that of the one in force
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
  std::size_t first_new = 0;  ///< from this one on, sessions came after the training of the model
                              ///< in force
};

/// The errors of the two models at the same judging rows, m rms; empty if they were not compared.
struct GateFigures {
  std::optional<double> before;  ///< of the one in force; for a first model, of the nominal one
  std::optional<double> after;   ///< of the candidate
  std::optional<double> limit;   ///< the value below which `after` had to be
};

struct GateVerdict {
  bool put_in_force = false;
  std::string message;  ///< before, after, limit and why
  bool undecided =
      false;  ///< too little data: nothing contradicts the candidate, and a person decides
  std::string why = {};  ///< of the message: the reason alone
  GateFigures figures = {};
  HeldBack held_back = HeldBack::kNo;  ///< also where the judges found it not better
};

/// True if `after` is so much worse that it is not chance, even with few judging rows: half as much
/// again (rms of the same poses).
[[nodiscard]] constexpr bool is_far_worse(double before, double after) {
  return after > 1.5 * before;
}

[[nodiscard]] GateVerdict judge(const GateQuestion& question, const GateOptions& options);

/// The sessions that show today's arm. If one of the models knows a dated change, only sessions
/// after it count. Otherwise the model in force decides: a session is strange if its median judging
/// row is twice as far off as that model expects. If the newest sessions are strange and came after
/// the model, the arm has changed, and only they count. Otherwise a strange session does not count.
/// If it was there before the model was trained, the sessions before it do not count either, since
/// they show an earlier arm.
[[nodiscard]] std::vector<JudgingSession> sessions_of_today(const GateQuestion& question);

}  // namespace trammel
