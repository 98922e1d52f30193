#include "server/health/health_check.h"

#include <algorithm>

#include "server/calibrate/batch_check.h"
#include "server/compensate/known_rows.h"
#include "server/health/evidence/working_poses.h"
#include "server/health/examination/examination.h"
#include "server/health/examination/seen_change.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

/// The result of a check that cannot even be begun.
HealthCheck too_few(const MeasurementBatch& batch, const HealthOptions& options,
                    const std::string& why) {
  HealthCheck check;
  check.poses = static_cast<int>(batch.measurements.size());
  check.tolerance = options.tolerance;
  check.sentence = why;
  return check;
}

/// True if the check names lost zeros, and nothing beyond chance remains.
bool is_all_by_zeros(const HealthCheck& check) {
  const auto leaves_nothing = [](const SeenChange& change) {
    const auto& others = change.could_also_be;
    return std::none_of(others.begin(), others.end(), [](const SingleCause& other) {
      return same_cause(other, health::unknown_cause());
    });
  };
  return !check.changed.empty() && !check.changed.front().zeros.empty() &&
         std::all_of(check.changed.begin(), check.changed.end(), leaves_nothing);
}

Result<HealthCheck> looked_through(const CompensatedModel& model, const MeasurementBatch& batch,
                                   const HealthOptions& options) {
  const MeasurementBatch known = known_rows(model, batch);
  if (known.measurements.empty()) {
    return refused("no pose has a tool and payload that model {} was trained with",
                   model.provenance().id)
        .in("batch " + batch.id);
  }
  const std::vector<PoseContext> contexts = health::contexts_of(model, known);
  const CauseEffects effects(model.parts().physics, contexts, model.parts().temperature_mean);
  const WorkingPoses working(effects, health::working_poses(model, contexts.front(), options.seed),
                             options.new_tool);
  Result<health::CheckRows> rows = health::check_rows(model, known, effects);
  if (!rows)
    return too_few(known, options,
                   "these poses do not say where the base stands: " + rows.error().message);
  const ErrorFigures& shown = model.parts().training.compensated;
  const int tails = health::tail_freedom_of(shown.rms > 0 ? shown.p997 / shown.rms : 0,
                                            model.parts().training.poses);
  HealthCheck check =
      health::Examination(options, effects, working, std::move(*rows), tails, model.cell().robot)
          .result({model.provenance().measured_at, batch.measured_at});
  check.model = model.provenance().id;
  return check;
}

}  // namespace

std::string_view to_string(HealthVerdict verdict) {
  switch (verdict) {
    case HealthVerdict::kHealthy:
      return "healthy";
    case HealthVerdict::kChanged:
      return "changed";
    case HealthVerdict::kCannotTell:
      return "cannot_tell";
  }
  return "cannot_tell";
}

Result<HealthCheck> check_health(const CompensatedModel& model, const CheckedBatch& batch,
                                 const HealthOptions& options) {
  if (const auto contacts = about_one_point(batch.rows()))
    return looked_through(model, *contacts, options);
  TRY(require_positions(batch.rows(), "a check"));
  if (has_sessions(batch.rows())) {
    return refused("a check is one set-up of the instrument, the batch has {}",
                   batch.rows().sessions.size())
        .in("batch " + batch.id())
        .of("session_id")
        .next("check each session by itself");
  }
  Result<HealthCheck> check = looked_through(model, batch.rows(), options);
  if (check && is_all_by_zeros(*check)) return check;
  if (std::optional<Error> doubt = reading_doubt(batch.rows(), model.cell()))
    return tl::make_unexpected(std::move(*doubt));
  return check;
}

}  // namespace trammel
