#include "server/measurement/checked_batch.h"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "server/base/check.h"
#include "server/measurement/gauges.h"
#include "server/measurement/history.h"
#include "server/measurement/pose_check.h"
#include "server/measurement/pose_columns.h"
#include "server/measurement/reading_doubt.h"
#include "server/measurement/sessions.h"
#include "server/measurement/split.h"
#include "server/measurement/spread_check.h"
#include "server/measurement/velocity.h"

namespace trammel {

namespace {

std::string name_of(const MeasurementBatch& batch) {
  return batch.where.empty() ? "batch " + batch.id : batch.where;
}

/// Shifts the times so that the first recorded one of each session is 0.
void rebase_times(std::vector<Measurement>& measurements) {
  std::map<int, double> origin;
  for (Measurement& m : measurements) {
    if (m.context.time) *m.context.time -= origin.emplace(m.session, *m.context.time).first->second;
  }
}

Status check_poses(MeasurementBatch& batch, const Cell& cell, const std::string& where) {
  const Anchors anchors = TRY(anchors_of(cell));
  for (Measurement& measurement : batch.measurements) {
    if (measurement.context.q.size() != cell.robot.size()) {
      return refused("{} joints, robot {} has {}", measurement.context.q.size(), cell.robot.name(),
                     cell.robot.size())
          .in(where)
          .at_row(measurement.row)
          .beyond(measurement.context.q.size(), cell.robot.size());
    }
    const Status pose = check_pose(measurement.context, cell);
    if (!pose) return Failure(pose.error()).in(where).at_row(measurement.row);
    const Status gauge = check_gauge(measurement, cell, anchors);
    if (!gauge) return Failure(gauge.error()).in(where).at_row(measurement.row);
  }
  return {};
}

bool earlier(const Measurement& a, const Measurement& b) {
  return std::pair(a.session, *a.context.time) < std::pair(b.session, *b.context.time);
}

/// Checks each session by itself: its positions are in a frame of its own.
Status check_spreads(const MeasurementBatch& recorded, const Cell& cell, const std::string& where) {
  const MeasurementBatch batch = positions_of(recorded);
  if (!has_sessions(batch)) return check_spread(batch, cell, where);
  for (const MeasurementBatch& session : by_session(batch)) {
    const Status fine =
        check_spread(session, cell, fmt::format("{}, session {}", where, session.id));
    if (!fine) return fine;
  }
  return {};
}

void mark(MeasurementBatch& batch, MeasurementSet set) {
  for (Measurement& m : batch.measurements) m.set = set;
}

/// Names of the sessions of `next` among those of other batches.
std::vector<std::string> session_names(const MeasurementBatch& next) {
  if (!has_sessions(next)) {
    const std::string& said = next.measurements.front().session_id;
    return {said.empty() || said == next.id ? next.id : next.id + "/" + said};
  }
  std::vector<std::string> names;
  for (const std::string& session : next.sessions) names.push_back(next.id + "/" + session);
  return names;
}

/// The numbers that identify a measurement: two rows share them only if they are copies. All digits
/// of joints and position count, and the tool and payload on the arm.
using Fingerprint =
    std::tuple<std::vector<double>, std::array<double, 3>, std::string, std::string>;

Fingerprint fingerprint_of(const Measurement& m) {
  return {std::vector<double>(m.context.q.begin(), m.context.q.end()),
          {m.p_W.x(), m.p_W.y(), m.p_W.z()},
          m.context.tool,
          m.context.payload};
}

/// A flag for each row of `batch`, true if `met` already has it. Adds the other rows to `met`.
std::vector<bool> copied_rows(const MeasurementBatch& batch, std::set<Fingerprint>& met) {
  std::vector<bool> copied;
  std::vector<Fingerprint> own;
  for (const Measurement& m : batch.measurements) {
    own.push_back(fingerprint_of(m));
    copied.push_back(m.p_W.allFinite() && met.contains(own.back()));
  }
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (batch.measurements[i].p_W.allFinite()) met.insert(std::move(own[i]));
  }
  return copied;
}

/// The batch without the rows of `left_out`, and without sessions that have no row left.
MeasurementBatch without_rows(const MeasurementBatch& batch, const std::vector<bool>& left_out) {
  MeasurementBatch rest = batch;
  rest.measurements.clear();
  rest.sessions.clear();
  int last = -1;
  for (std::size_t i = 0; i < left_out.size(); ++i) {
    if (left_out[i]) continue;
    Measurement m = batch.measurements[i];
    if (has_sessions(batch) && m.session != last) {
      last = m.session;
      rest.sessions.push_back(batch.sessions[static_cast<std::size_t>(last)]);
    }
    m.session = rest.sessions.empty() ? 0 : static_cast<int>(rest.sessions.size()) - 1;
    rest.measurements.push_back(std::move(m));
  }
  return rest;
}

/// Appends the measurements of `next` after those of `all`, as sessions of their own.
void append(MeasurementBatch& all, const MeasurementBatch& next) {
  const auto first = static_cast<int>(all.sessions.size());
  for (Measurement m : next.measurements) {
    m.pose_id = next.id + "/" + m.pose_id;
    m.context.index = static_cast<int>(all.measurements.size());
    m.session += first;
    m.extra.clear();
    all.measurements.push_back(std::move(m));
  }
  for (std::string& name : session_names(next)) all.sessions.push_back(std::move(name));
  all.joint_types = next.joint_types;
  all.measured_at = std::max(all.measured_at, next.measured_at);
  all.id += (all.id.empty() ? "" : "+") + next.id;
  all.source_text += next.source_text;
}

/// Adds the passive joints that the file leaves out, in all poses, referenced ones included.
void complete_passive_joints(const Chain& robot, MeasurementBatch& batch) {
  std::vector<PoseContext*> poses;
  for (Measurement& m : batch.measurements) {
    poses.push_back(&m.context);
    if (!m.gauge || !m.gauge->minus) continue;
    const auto minus = std::make_shared<PoseContext>(*m.gauge->minus);
    poses.push_back(minus.get());
    m.gauge->minus = minus;
  }
  put_in_passive_joints(robot, batch.joint_types, poses);
}

}  // namespace

HoldOut drawn(double share, std::uint64_t seed) {
  return [share, seed](const MeasurementBatch& batch) { return rows_held_out(batch, share, seed); };
}

CheckedBatch::CheckedBatch(MeasurementBatch rows, std::vector<bool> is_held_out, std::string hash) {
  BatchSplit split = split_rows(rows, is_held_out);
  mark(split.train, MeasurementSet::kTrain);
  mark(split.validation, MeasurementSet::kValidation);
  content_ = std::make_shared<const Content>(Content{std::move(rows), std::move(split.train),
                                                     std::move(split.validation),
                                                     std::move(is_held_out), std::move(hash)});
}

CheckedBatch CheckedBatch::holding_out(const std::vector<bool>& flags) const {
  TRAMMEL_CHECK(flags.size() == size());
  std::vector<bool> both = content_->is_held_out;
  for (std::size_t i = 0; i < both.size(); ++i) both[i] = both[i] || flags[i];
  return both == content_->is_held_out ? *this : CheckedBatch(rows(), std::move(both), hash());
}

bool CheckedBatch::is_in_order_of_time() const {
  const auto& poses = rows().measurements;
  if (!std::all_of(poses.begin(), poses.end(),
                   [](const Measurement& m) { return m.context.time.has_value(); })) {
    return true;
  }
  return std::is_sorted(poses.begin(), poses.end(), earlier);
}

CheckedBatch CheckedBatch::in_order_of_time(const Chain& robot) const {
  if (is_in_order_of_time()) return *this;
  const auto& before = rows().measurements;
  std::vector<std::size_t> order(before.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return earlier(before[a], before[b]); });
  MeasurementBatch sorted = rows();
  std::vector<bool> is_held_out(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    sorted.measurements[i] = before[order[i]];
    sorted.measurements[i].context.index = static_cast<int>(i);
    is_held_out[i] = content_->is_held_out[order[i]];
  }
  fill_velocity(sorted);
  fill_history(sorted, robot);
  return {std::move(sorted), std::move(is_held_out), hash()};
}

Result<CheckedBatch> check_against_cell(MeasurementBatch batch, const Cell& cell,
                                        const HoldOut& hold_out) {
  const std::string where = name_of(batch);
  if (batch.measurements.empty())
    return refused("no measurements, at least 1 is needed").in(where).beyond(0, 1);
  // A batch that was never a file has a text as well: its parts are known by the text of the whole.
  if (batch.source_text.empty()) batch.source_text = to_csv(batch);
  std::string hash = batch_hash(batch);
  if (batch.joint_types.empty()) batch.joint_types = joint_types(cell.robot);
  complete_passive_joints(cell.robot, batch);
  TRY(check_joint_columns(batch.joint_types, cell.robot, where));
  divide_into_sessions(batch);
  rebase_times(batch.measurements);
  const auto with_reading = [&](const Error& why) {
    return tl::make_unexpected(has_gauges(batch) ? why : with_likely_reading(why, batch, cell));
  };
  if (const Status poses = check_poses(batch, cell, where); !poses)
    return with_reading(poses.error());
  if (const Status spread = check_spreads(batch, cell, where); !spread)
    return with_reading(spread.error());
  fill_velocity(batch);
  fill_history(batch, cell.robot);
  std::vector<bool> is_held_out = hold_out(batch);
  return CheckedBatch(std::move(batch), std::move(is_held_out), std::move(hash));
}

CheckedBatch joined(std::vector<CheckedBatch> batches) {
  TRAMMEL_CHECK(!batches.empty());
  if (batches.size() == 1) return batches.front();
  const auto clock = [](const CheckedBatch& batch) { return batch.rows().clock; };
  MeasurementBatch all;
  if (std::all_of(batches.begin(), batches.end(),
                  [&](const CheckedBatch& one) { return clock(one).has_value(); })) {
    std::stable_sort(
        batches.begin(), batches.end(),
        [&](const CheckedBatch& a, const CheckedBatch& b) { return *clock(a) < *clock(b); });
    all.clock = clock(batches.back());
  }
  std::vector<bool> is_held_out;
  std::set<Fingerprint> met;
  std::size_t taken = 0;
  for (const CheckedBatch& batch : batches) {
    const std::vector<bool> copied = copied_rows(batch.rows(), met);
    const auto copies = static_cast<int>(std::count(copied.begin(), copied.end(), true));
    all.copies += copies;
    if (static_cast<std::size_t>(copies) == batch.size()) continue;
    ++taken;
    append(all, copies == 0 ? batch.rows() : without_rows(batch.rows(), copied));
    for (std::size_t i = 0; i < copied.size(); ++i) {
      if (!copied[i]) is_held_out.push_back(batch.content_->is_held_out[i]);
    }
  }
  if (taken == 1) {  // all others are copies of the first one
    MeasurementBatch rows = batches.front().rows();
    rows.copies = all.copies;
    return CheckedBatch(std::move(rows), std::move(is_held_out), batches.front().hash());
  }
  std::string hash = batch_hash(all);
  return CheckedBatch(std::move(all), std::move(is_held_out), std::move(hash));
}

}  // namespace trammel
