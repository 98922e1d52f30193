#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"
#include "server/health/drift.h"
#include "server/health/foreign_poses.h"
#include "server/health/health_verdict.h"
#include "server/measurement/checked_batch.h"
#include "server/plan/check_design.h"

/// Checks with a few poses whether a robot is still the one that its model was trained on.
namespace trammel {

/// Tests `batch` against `model`. The tracker may stand anywhere, so the base is located anew.
/// Poses with a tool or payload that the model was not trained with do not count; a batch without
/// other poses is refused. Refuses several set-ups, and a misread batch (reading_doubt()), unless
/// lost zeros explain all of its poses. If the poses are off by more than 5 mm, only lost zeros and
/// a displaced tool can be named; otherwise the verdict is that nothing can be told.
///
/// The residuals of all poses are r = B b (+ T t) + J theta + e with e ~ N(0, S). S has the
/// measurement's noise, the uncertainty of the parameters, and the model error, which neighbouring
/// poses share. It is scaled so that the model's own held-out poses have their actual size. Each
/// single cause is tested beside base (and tool), and all together are tested as a whole. The limit
/// for the p-values is such that the smallest of them stays above it in 1 - `false_alarm` of
/// simulated healthy checks at these very poses.
///
/// If a check is beyond that limit, zeros that several joints lost at once are tried first, with or
/// without a displaced tool; then single causes, one after the other. An error of any form over a
/// joint's angle is named only if it leaves no residual beyond chance. Causes that explain as much
/// as a named one are listed beside it.
[[nodiscard]] Result<HealthCheck> check_health(const CompensatedModel& model,
                                               const CheckedBatch& batch,
                                               const HealthOptions& options);

}  // namespace trammel
