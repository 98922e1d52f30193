#include "server/diagnose/tell/between_sessions.h"

#include <algorithm>
#include <cmath>

#include "server/diagnose/search/naming.h"
#include "server/diagnose/thresholds.h"
#include "server/measurement/sessions.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;

constexpr int kFewestRepeated = 12;  // degrees of freedom: a standard deviation is known to a fifth

/// The noise of one axis beyond the stated one that repeats confirm.
double beyond_stated(double repeated, double stated, int freedom) {
  if (repeated > thresholds::kRepeatsVouch * stated) return 0;
  return freedom < kFewestRepeated
             ? 0
             : std::sqrt(std::max(0.0, repeated * repeated - stated * stated));
}

/// The place among `sessions` of each pose of the batch.
std::vector<std::size_t> sessions_of_poses(const MeasurementBatch& batch,
                                           const std::vector<SessionSetting>& sessions) {
  std::vector<std::size_t> places;
  for (const Measurement& m : batch.measurements) {
    const auto after =
        std::find_if(sessions.begin() + 1, sessions.end(),
                     [&](const SessionSetting& one) { return m.context.index < one.first; });
    places.push_back(static_cast<std::size_t>(after - sessions.begin()) - 1);
  }
  return places;
}

bool are_warm_unseen(const MeasurementBatch& rows) {
  return std::any_of(rows.measurements.begin(), rows.measurements.end(),
                     [](const Measurement& m) { return !m.context.temperature; });
}

/// True if that pose is the first of a session.
bool begins_a_session(const MeasurementBatch& rows, const std::string& pose_id) {
  const auto& all = rows.measurements;
  for (std::size_t i = 1; i < all.size(); ++i)
    if (all[i].pose_id == pose_id && all[i].session != all[i - 1].session) return true;
  return false;
}

/// True if the finding may have begun with a session.
bool may_begin_with_session(const Finding& finding, const MeasurementBatch& rows) {
  return begins_a_session(rows, finding.cause.pose_id) ||
         std::any_of(
             finding.may_begin_at.begin(), finding.may_begin_at.end(),
             [&](const PossibleBeginning& one) { return begins_a_session(rows, one.pose_id); });
}

}  // namespace

std::vector<SessionSetting> with_noise_as_repeated(std::vector<SessionSetting> sessions,
                                                   const MeasurementBatch& rows,
                                                   const Tracker& tracker) {
  const std::vector<MeasurementBatch> apart = by_session(rows);
  for (SessionSetting& session : sessions) {
    const auto own = std::find_if(apart.begin(), apart.end(), [&](const MeasurementBatch& one) {
      return one.id == session.id;
    });
    RepeatStatistics repeated;
    if (own != apart.end()) repeated = merge_repeats(*own, tracker.sigma).statistics;
    session.own_noise = std::min(session.own_noise, beyond_stated(repeated.sigma, tracker.sigma,
                                                                  repeated.degrees_of_freedom));
    session.own_noise_rotation = std::min(
        session.own_noise_rotation, beyond_stated(repeated.sigma_rotation, tracker.sigma_rotation,
                                                  repeated.rotation_degrees_of_freedom));
  }
  return sessions;
}

std::vector<LeftBySession> left_by_session(const LinearProblem& problem,
                                           const Background& background,
                                           const std::vector<SessionSetting>& sessions) {
  std::vector<LeftBySession> all;
  if (sessions.size() < 2) return all;
  const LinearProblem::Spread& spread = problem.position_spread();
  const double share = spread.freedom / (3.0 * static_cast<double>(problem.poses()));
  const Eigen::Matrix3Xd left = problem.positions(background.project(problem.residual()));
  const std::vector<std::size_t> places = sessions_of_poses(problem.batch(), sessions);
  for (std::size_t s = 0; s < sessions.size(); ++s) {
    double square = 0, poses = 0;
    for (Index i = 0; i < problem.poses(); ++i) {
      if (places[static_cast<std::size_t>(i)] != s) continue;
      square += left.col(i).squaredNorm();
      ++poses;
    }
    const double freedom = 3 * share * poses;
    const double stddev = freedom > 0 ? std::sqrt(square / freedom) : 0;
    const double stated = std::hypot(spread.stated, sessions[s].own_noise);
    all.push_back({sessions[s].id, {stddev, stated, freedom}});
  }
  return all;
}

std::vector<Cause> rivals_between_sessions(const Cause& cause, const MeasurementBatch& rows) {
  const CauseRecord& own = record_of(cause);
  if (own.lasting != causes::Lasting::kFromAPose || own.scope == causes::Scope::kJoint) return {};
  std::vector<Cause> rivals;
  for (const CauseRecord* other : all_causes()) {
    if (other->search == causes::SearchFamily::kNone || other->lasting != causes::Lasting::kAlways)
      continue;
    const bool softer = part_of(cause) == causes::Part::kPayload && other->gives_way &&
                        other->scope == causes::Scope::kArm;
    const bool warmer = other->needs.temperature && are_warm_unseen(rows);
    if (softer || warmer) rivals.push_back(cause_at(*other));
  }
  return rivals;
}

void tell_since(const MeasurementBatch& rows, Diagnosis& diagnosis) {
  if (!has_sessions(rows)) return;
  for (Finding& finding : diagnosis.findings) {
    const auto pose =
        std::find_if(rows.measurements.begin(), rows.measurements.end(), [&](const Measurement& m) {
          return !finding.cause.pose_id.empty() && m.pose_id == finding.cause.pose_id;
        });
    if (pose == rows.measurements.end()) continue;
    finding.since_session = rows.sessions[static_cast<std::size_t>(pose->session)];
    if (!may_begin_with_session(finding, rows)) continue;
    for (const Cause& rival : rivals_between_sessions(finding.cause, rows))
      add(finding.could_also_be, rival);
  }
}

void doubt_changes(const MeasurementBatch& rows, Diagnosis& diagnosis) {
  for (SessionChange& change : diagnosis.between_sessions) {
    std::vector<Cause> rivals = rivals_between_sessions({.cause = change.cause}, rows);
    if (diagnosis.unexplained.present) rivals.push_back(unknown_cause());
    for (const Cause& rival : rivals) {
      const std::string spelled = to_string(rival);
      auto& others = change.could_also_be;
      if (std::find(others.begin(), others.end(), spelled) == others.end())
        others.push_back(spelled);
    }
  }
}

}  // namespace trammel::cause_search
