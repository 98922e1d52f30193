#pragma once

#include "server/calibrate/identify/weighting.h"
#include "server/calibrate/sessions/session_setting.h"

/// Sessions with more measurement noise than the others, which therefore get less weight.
namespace trammel {

/// Sets own_noise of each session. The estimate is the median of the session's squared residuals,
/// relative to the level that the other sessions suggest; bad poses hardly change a median. A
/// session gets excess noise only if the excess is beyond chance. `r` are the residuals of `batch`,
/// and `freedom` counts the parameters fitted to them.
void set_own_noise(const Residuals& r, const Freedom& freedom, const Weights& weights,
                   const MeasurementBatch& batch, std::vector<SessionSetting>& sessions);

/// True if measurements have nearly the same sigmas under both.
[[nodiscard]] bool are_as_noisy(const std::vector<SessionSetting>& now,
                                const std::vector<SessionSetting>& before, const Tracker& tracker);

/// The sigmas of `batch` for its residuals.
void set_sigmas(const MeasurementBatch& batch, const Tracker& tracker, Residuals& r);

}  // namespace trammel
