#include "server/measurement/velocity.h"

#include <algorithm>
#include <vector>

namespace trammel {

namespace {

constexpr std::size_t kLeastPoses = 3;
constexpr double kLongestStep = 1;      // s
constexpr double kLongestToMedian = 3;  // ratio
constexpr double kLargestMove = 0.2;    // rad, m

bool is_continuous_path(const std::vector<Measurement>& path) {
  if (path.size() < kLeastPoses) return false;
  if (!std::all_of(path.begin(), path.end(),
                   [](const Measurement& m) { return m.context.time.has_value(); })) {
    return false;
  }
  std::vector<double> steps;
  for (std::size_t i = 1; i < path.size(); ++i) {
    const PoseContext& before = path[i - 1].context;
    const PoseContext& after = path[i].context;
    if (before.q.size() != after.q.size()) return false;
    if ((after.q - before.q).lpNorm<Eigen::Infinity>() > kLargestMove) return false;
    steps.push_back(*after.time - *before.time);
  }
  const auto [shortest, longest] = std::minmax_element(steps.begin(), steps.end());
  if (!(*shortest > 0) || *longest > kLongestStep) return false;
  const double longest_step = *longest;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return longest_step <= kLongestToMedian * *middle;
}

/// Slope at `time` of the parabola through three poses.
JointVector slope(const PoseContext& a, const PoseContext& b, const PoseContext& c, double time) {
  const double h0 = *b.time - *a.time;
  const double h1 = *c.time - *b.time;
  const JointVector first = (b.q - a.q) / h0;                         // at the middle of a and b
  const JointVector second = ((c.q - b.q) / h1 - first) / (h0 + h1);  // half the acceleration
  return first + second * (2 * time - *a.time - *b.time);
}

/// Fills in the rows [first, end), which are of one session.
bool fill_velocity_of(MeasurementBatch& batch, std::size_t first, std::size_t end) {
  const auto at = [&](std::size_t i) {
    return batch.measurements.begin() + static_cast<std::ptrdiff_t>(i);
  };
  const std::vector<Measurement> path(at(first), at(end));
  if (!is_continuous_path(path)) return false;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const std::size_t middle = std::clamp<std::size_t>(i, 1, path.size() - 2);
    batch.measurements[first + i].context.velocity =
        slope(path[middle - 1].context, path[middle].context, path[middle + 1].context,
              *path[i].context.time);
  }
  return true;
}

}  // namespace

bool fill_velocity(MeasurementBatch& batch) {
  bool any = false;
  for (Measurement& m : batch.measurements) m.context.velocity.reset();
  for (std::size_t first = 0; first < batch.measurements.size();) {
    std::size_t end = first;
    while (end < batch.measurements.size() &&
           batch.measurements[end].session == batch.measurements[first].session)
      ++end;
    any = fill_velocity_of(batch, first, end) || any;
    first = end;
  }
  return any;
}

}  // namespace trammel
