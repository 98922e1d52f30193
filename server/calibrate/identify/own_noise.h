#pragma once

#include "server/calibrate/identify/weighting.h"
#include "server/calibrate/sessions/session_setting.h"

/// Sessions that were measured with more noise than the others, so that they count for less.
namespace trammel {

/// Sets own_noise of each session. The median of its squared residuals, in units of what the rest
/// of the sessions suggests, tells how noisy it is; bad poses do not matter to it. A session is as
/// noisy as the others unless it is more so than chance would make it. `r` are the residuals of
/// `batch`, to which so many parameters were fitted.
void set_own_noise(const Residuals& r, const Freedom& freedom, const Weights& weights,
                   const MeasurementBatch& batch, std::vector<SessionSetting>& sessions);

/// True if measurements have nearly the same sigmas under both.
[[nodiscard]] bool are_as_noisy(const std::vector<SessionSetting>& now,
                                const std::vector<SessionSetting>& before, const Tracker& tracker);

/// The sigmas of `batch` for its residuals.
void set_sigmas(const MeasurementBatch& batch, const Tracker& tracker, Residuals& r);

}  // namespace trammel
