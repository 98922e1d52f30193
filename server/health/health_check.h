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

/// The check whether a robot still is the one that its model was trained on, by a few poses.
namespace trammel {

/// Holds `batch` against `model`. The tracker may stand anywhere: the base is found anew. Poses
/// whose tool or payload the model was not trained with do not count; a batch that has no other is
/// refused. So is one of several set-ups, and one that was not read as it was meant
/// (reading_doubt()), unless lost zeros explain all of its poses. Where the poses are off by more
/// than 5 mm only lost zeros and a tool that sits elsewhere are named; else nothing can be told.
///
/// The residuals of all poses are r = B b (+ T t) + J theta + e with e ~ N(0, S): S has the
/// measurement's noise, what the parameters leave uncertain, and what the model leaves over, which
/// poses near each other share; it is scaled so that the model's own held-out poses have the size
/// that they had. Each single cause is tested beside base (and tool), and everything together. The
/// limit on their p-values is the one that the smallest of them stays above in 1 - `false_alarm` of
/// simulated healthy checks at these very poses.
///
/// Where a check is beyond that limit, zeros that several joints lost at once are tried first, with
/// or without a tool that sits elsewhere; then single causes, one after the other. An error of any
/// form over a joint's angle is named only where it leaves nothing beyond chance. Causes that
/// explain as much as a named one stand beside it.
[[nodiscard]] Result<HealthCheck> check_health(const CompensatedModel& model,
                                               const CheckedBatch& batch,
                                               const HealthOptions& options);

}  // namespace trammel
