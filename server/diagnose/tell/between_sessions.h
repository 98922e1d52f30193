#pragma once

#include <string>
#include <vector>

#include "server/calibrate/sessions/session_setting.h"
#include "server/diagnose/tell/answers.h"

/// Several sessions judge each other. What is left of a session is no noise because it is left:
/// only the stated sigma, poses measured repeatedly and the other sessions say what noise is.
namespace trammel::cause_search {

/// `sessions` with the noise that each has beyond the others, as far as its own repeated poses show
/// it; without enough of them none. `rows`: of all sessions, where they were measured.
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
/// Between two sessions more changes than begins at a pose while it is measured: gearboxes wear,
/// arms are warm. `cause` begins at the first pose of a session: what may have changed instead.
/// Sources as the contract spells them.
[[nodiscard]] std::vector<Cause> rivals_between_sessions(const Cause& cause,
                                                         const MeasurementBatch& rows);

/// In which session each finding began that begins at a pose, and what that leaves open.
void tell_since(const MeasurementBatch& rows, Diagnosis& diagnosis);

/// A change between sessions is not sure where more than noise is left beside it, or where
/// something else does the same.
void doubt_changes(const MeasurementBatch& rows, Diagnosis& diagnosis);

}  // namespace trammel::cause_search
