#include "server/calibrate/sessions/locate_sessions.h"

#include <algorithm>
#include <numeric>

#include "server/calibrate/frames/frames.h"
#include "server/measurement/sessions.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

/// The base from orientations, where the positions do not span a plane. Tools that are unknown do
/// not count.
Result<Pose> base_by_orientations(const PhysicalModel& model, const MeasurementBatch& session,
                                  const Error& why) {
  Matrix3 turn = Matrix3::Zero();
  Vector3 p_W = Vector3::Zero(), p_B = Vector3::Zero();
  double count = 0;
  for (const Measurement& m : session.measurements) {
    const auto& X_FT = model.cell->tools.at(m.context.tool);
    if (!X_FT || !m.R_WT) continue;
    const Pose X_BT = model.cell->robot.flange_pose(m.context.q) * *X_FT;
    turn += *m.R_WT * X_BT.linear().transpose();
    p_W += m.p_W;
    p_B += X_BT.translation();
    ++count;
  }
  if (count == 0) return tl::make_unexpected(why);
  const Matrix3 R_WB = nearest_rotation(turn);
  return make_pose(R_WB, (p_W - R_WB * p_B) / count);
}

/// X_WB of the session. Unknown tools of `model` are located with it and put into the model's cell.
Result<Pose> base_of(PhysicalModel& model, const MeasurementBatch& session) {
  PhysicalModel here = model;
  const Status located = locate_unknown_frames(here, session);
  if (!located) return base_by_orientations(model, session, located.error());
  auto cell = std::make_shared<Cell>(*model.cell);
  for (const Measurement& m : session.measurements) {
    std::optional<Pose>& known = cell->tools.at(m.context.tool);
    if (!known) known = here.tools.at(m.context.tool);
  }
  model.cell = std::move(cell);
  return here.X_WB;
}

}  // namespace

Result<std::vector<SessionSetting>> locate_sessions(const PhysicalModel& model,
                                                    const MeasurementBatch& batch) {
  PhysicalModel anywhere = model;
  auto cell = std::make_shared<Cell>(*model.cell);
  cell->X_WB.reset();
  anywhere.cell = std::move(cell);
  const std::vector<MeasurementBatch> sessions = by_session(batch);
  std::vector<SessionSetting> settings = settings_of(batch);
  // The largest session first: it determines best a tool that the cell does not know.
  std::vector<std::size_t> order(sessions.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return sessions[a].measurements.size() > sessions[b].measurements.size();
  });
  for (const std::size_t s : order) {
    const Result<Pose> X_WB = base_of(anywhere, sessions[s]);
    if (!X_WB)
      return Failure(X_WB.error())
          .in(fmt::format("batch {}, session {}", batch.id, settings[s].id));
    settings[s].X_WS = *X_WB;
  }
  const Pose X_WB = settings.back().X_WS;
  for (SessionSetting& setting : settings) setting.X_WS = X_WB * setting.X_WS.inverse();
  settings.back().X_WS = Pose::Identity();
  return settings;
}

}  // namespace trammel
