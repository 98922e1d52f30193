#include "server/compensate/world.h"

#include <algorithm>
#include <cmath>

#include "server/compensate/known_rows.h"
#include "server/error_sources/anchors.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

/// The setting in the model; null if it does not know the session.
const SessionSetting* known_session(const CompensatedModel& model, const std::string& name) {
  const std::vector<SessionSetting>& sessions = model.parts().sessions;
  const auto found =
      std::find_if(sessions.begin(), sessions.end(),
                   [&](const SessionSetting& session) { return session.id == name; });
  return found == sessions.end() ? nullptr : &*found;
}

/// The names that a batch, or a part of one, may have as a session of the model.
const SessionSetting* known_session(const CompensatedModel& model, const MeasurementBatch& batch,
                                    const std::string& session) {
  for (const std::string& name : {session, batch.id + "/" + session, batch.id}) {
    if (name.empty() || (name == batch.id && has_sessions(batch) && session != batch.id)) continue;
    if (const SessionSetting* known = known_session(model, name)) return known;
  }
  return nullptr;
}

/// The place of the session's world by the rows themselves.
Result<Pose> located(const CompensatedModel& model, const MeasurementBatch& session) {
  const MeasurementBatch rows = known_rows(model, session);
  if (rows.measurements.empty())
    return refused("the model knows none of its tools").in("session " + session.id);
  const Pose X_WB = model.parts().physics.X_WB;
  Eigen::Matrix3Xd p_W(3, static_cast<Eigen::Index>(rows.measurements.size()));
  for (Eigen::Index i = 0; i < p_W.cols(); ++i)
    p_W.col(i) = rows.measurements[static_cast<std::size_t>(i)].p_W;
  const Eigen::Matrix3Xd p_B = X_WB.inverse() * p_W - model.errors_B(rows).compensated;
  const Result<Pose> X_SB = fit_transform(p_W, p_B);
  if (!X_SB) return Failure(X_SB.error()).in("session " + session.id);
  return X_WB * X_SB->inverse();
}

constexpr double kOtherSetUp = 3;          // times the residual with the rows placed by themselves
constexpr double kSlack = 1e-4;            // m
constexpr int kAfterEverything = 1 << 20;  // index of a pose after all sessions

/// m rms: the model's residuals of the rows, moved into W by the setting.
double left_of(const CompensatedModel& model, const MeasurementBatch& session,
               const Similarity& into_W, int index) {
  MeasurementBatch rows = known_rows(model, session);
  rows.as_then = true;
  if (rows.measurements.empty()) return 0;
  for (Measurement& m : rows.measurements) {
    m.p_W = into_W * m.p_W;
    m.context.index = index;
  }
  return std::sqrt(model.errors_B(rows).compensated.colwise().squaredNorm().mean());
}

/// True if the rows were measured from the place where the instrument of that session stood; names
/// may be reused.
bool is_same_set_up(const CompensatedModel& model, const MeasurementBatch& session,
                    const SessionSetting& known) {
  const Result<Pose> X_WS = located(model, session);
  if (!X_WS) return true;
  return left_of(model, session, known.into_W(), known.first) <=
         kOtherSetUp * left_of(model, session, {*X_WS}, known.first) + kSlack;
}

/// The batch is one session.
MeasurementBatch of_one(const CompensatedModel& model, const MeasurementBatch& batch) {
  const std::string& said =
      batch.measurements.empty() ? batch.id : batch.measurements.front().session_id;
  const SessionSetting* known = known_session(model, batch, said);
  if (known == nullptr || !is_same_set_up(model, batch, *known)) return batch;
  MeasurementBatch here = batch;
  here.as_then = !model.parts().changes.empty();
  for (Measurement& m : here.measurements) {
    m.session = 0;
    m.context.index = known->first;
  }
  return aligned(std::move(here), {*known}, model.cell().tracker);
}

}  // namespace

namespace {

/// Refuses gauges that the model cannot predict: with several set-ups to be placed, or to an anchor
/// whose place neither the model nor its cell file knows.
Status check_gauges(const CompensatedModel& model, const MeasurementBatch& batch) {
  if (!has_gauges(batch)) return {};
  if (has_sessions(batch))
    return require_positions(batch, "placing several set-ups of the instrument");
  const Anchors anchors = TRY(anchors_of(model.cell()));
  for (const Measurement& m : batch.measurements) {
    if (!m.gauge || m.gauge->kind == Gauge::Kind::kApart ||
        placed_anchor(model.parts().physics, m.gauge->anchor).said != nullptr)
      continue;
    const auto known = anchors.find(m.gauge->anchor);
    if (known != anchors.end() && known->second.p_W) continue;
    return refused("model {} does not know where anchor '{}' is", model.provenance().id,
                   m.gauge->anchor)
        .in("batch " + batch.id)
        .at_row(m.row)
        .of("anchor_id")
        .with_text(m.gauge->anchor)
        .next("give its xyz_mm in the cell file before training, or train with distances to it");
  }
  return {};
}

}  // namespace

Result<InWorld> in_world_of(const CompensatedModel& model, const MeasurementBatch& batch) {
  TRY(check_gauges(model, batch));
  if (has_gauges(batch)) return InWorld{batch};
  if (!has_sessions(batch)) return InWorld{of_one(model, batch)};
  std::vector<SessionSetting> settings = settings_of(batch);
  std::vector<int> index(settings.size(), kAfterEverything);
  InWorld world;
  const std::vector<MeasurementBatch> sessions = by_session(batch);
  for (std::size_t s = 0; s < sessions.size(); ++s) {
    const SessionSetting* known = known_session(model, batch, batch.sessions[s]);
    if (known != nullptr && is_same_set_up(model, sessions[s], *known)) {
      settings[s].set_into_W(known->into_W());
      settings[s].own_noise = known->own_noise;
      settings[s].own_noise_rotation = known->own_noise_rotation;
      index[s] = known->first;
      continue;
    }
    const Pose X_WS = TRY(located(model, sessions[s]));
    settings[s].X_WS = X_WS;
    world.located.push_back(batch.sessions[s]);
  }
  world.batch = aligned(batch, settings, model.cell().tracker);
  world.batch.as_then = !model.parts().changes.empty();
  for (Measurement& m : world.batch.measurements)
    m.context.index = index[static_cast<std::size_t>(m.session)];
  return world;
}

}  // namespace trammel
