#pragma once

#include <string>
#include <vector>

#include "server/calibrate/sessions/session_setting.h"
#include "server/diagnose/tell/answers.h"

/// Several sessions judge each other. The residual of a session does not count as noise by itself:
/// only the stated sigma, repeated poses and the other sessions show the noise.
namespace trammel::cause_search {

/// `sessions` with the excess noise of each over the others, as far as its own repeated poses show
/// it; 0 without enough repeats. `rows`: those of all sessions, as measured.
[[nodiscard]] std::vector<SessionSetting> with_noise_as_repeated(
    std::vector<SessionSetting> sessions, const MeasurementBatch& rows, const Tracker& tracker);

/// The residual of one session.
struct LeftBySession {
  std::string id;
  LeftOver left;  ///< of positions
};
/// In the order of the sessions; none where there is one.
[[nodiscard]] std::vector<LeftBySession> left_by_session(
    const LinearProblem& problem, const Background& background,
    const std::vector<SessionSetting>& sessions);
/// Between two sessions more can change than during one: gearboxes wear, arms warm up. Returns the
/// alternatives to `cause`, which begins at the first pose of a session. Sources as the contract
/// spells them.
[[nodiscard]] std::vector<Cause> rivals_between_sessions(const Cause& cause,
                                                         const MeasurementBatch& rows);

/// Sets the session in which each step-like finding began, and the questions that this leaves open.
void tell_since(const MeasurementBatch& rows, Diagnosis& diagnosis);

/// Marks a change between sessions as uncertain if more than noise is left beside it, or if another
/// cause has the same effect.
void doubt_changes(const MeasurementBatch& rows, Diagnosis& diagnosis);

}  // namespace trammel::cause_search
