#include "server/measurement/history.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace trammel {

namespace {

using Rows = std::span<Measurement>;

bool is_in_order(const Rows& rows) {
  const auto timed = [](const Measurement& m) { return m.context.time.has_value(); };
  return std::all_of(rows.begin(), rows.end(), timed) &&
         std::is_sorted(rows.begin(), rows.end(), [](const Measurement& a, const Measurement& b) {
           return *a.context.time < *b.context.time;
         });
}

/// True if the recorded sides of the gears allow that the robot came from `before` to `now`.
bool may_come_from(const JointVector& before, const PoseContext& now, const Chain& robot) {
  if (before.size() != now.q.size()) return false;
  if (now.direction.empty()) return true;
  const JointVector way = robot.gear_angles(now.q - before);
  for (std::size_t j = 0; j < now.direction.size(); ++j) {
    if (now.direction[j] * way(static_cast<Eigen::Index>(j)) < 0) return false;
  }
  return true;
}

void fill_before(const Rows& rows, const Chain& robot) {
  for (std::size_t i = 1; i < rows.size(); ++i) {
    PoseContext& now = rows[i].context;
    const JointVector& before = rows[i - 1].context.q;
    if (!now.velocity && may_come_from(before, now, robot)) now.before = before;
  }
}

/// The state of a body that follows by `lag`, `time` later, while the temperature went evenly from
/// `from` to `to`.
double followed(double body, double from, double to, double time, double lag) {
  if (!(time > 0)) return body;
  const double behind = (to - from) / time * lag;  // K: the lag that remains in the end
  return to - behind + (body - from + behind) * std::exp(-time / lag);
}

void fill_lagged(const Rows& rows) {
  const auto warm = [](const Measurement& m) { return m.context.temperature.has_value(); };
  if (rows.empty() || !std::all_of(rows.begin(), rows.end(), warm)) return;
  rows.front().context.lagged.assign(kHeatLags.size(), *rows.front().context.temperature);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const PoseContext& then = rows[i - 1].context;
    PoseContext& now = rows[i].context;
    for (std::size_t k = 0; k < kHeatLags.size(); ++k)
      now.lagged.push_back(followed(then.lagged[k], *then.temperature, *now.temperature,
                                    *now.time - *then.time, kHeatLags[k]));
  }
}

}  // namespace

void fill_history(MeasurementBatch& batch, const Chain& robot) {
  const Rows all(batch.measurements);
  for (Measurement& m : all) {
    m.context.before.reset();
    m.context.lagged.clear();
  }
  for (std::size_t first = 0; first < all.size();) {
    std::size_t end = first;
    while (end < all.size() && all[end].session == all[first].session) ++end;
    const Rows session = all.subspan(first, end - first);
    if (is_in_order(session)) {
      fill_before(session, robot);
      fill_lagged(session);
    }
    first = end;
  }
}

}  // namespace trammel
