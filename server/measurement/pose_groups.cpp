#include "server/measurement/pose_groups.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace trammel {
namespace {

using Eigen::Index;

constexpr double kSameJoints = 1e-6;  // rad, m: the same limits as for repeats

}  // namespace

std::vector<PoseGroup> pose_groups(const Eigen::MatrixXd& q) {
  std::map<std::vector<long long>, std::size_t> place;
  std::vector<PoseGroup> groups;
  for (Index i = 0; i < q.rows(); ++i) {
    std::vector<long long> key;
    for (Index j = 0; j < q.cols(); ++j) key.push_back(std::llround(q(i, j) / kSameJoints));
    const auto [at, is_new] = place.try_emplace(std::move(key), groups.size());
    if (is_new) groups.emplace_back();
    groups[at->second].push_back(i);
  }
  return groups;
}

std::vector<PoseGroup> pose_groups(const std::vector<JointVector>& q) {
  if (q.empty()) return {};
  Eigen::MatrixXd rows(std::ssize(q), q.front().size());
  for (Index i = 0; i < rows.rows(); ++i) rows.row(i) = q[static_cast<std::size_t>(i)].transpose();
  return pose_groups(rows);
}

std::vector<PoseGroup> pose_groups(const MeasurementBatch& batch) {
  std::vector<JointVector> q;
  for (const Measurement& m : batch.measurements) q.push_back(m.context.q);
  return pose_groups(q);
}

bool are_seen_together(const Measurement& a, const Measurement& b) {
  return !a.gauge && !b.gauge && a.session == b.session &&
         a.context.direction == b.context.direction;
}

std::vector<PoseGroup> groups_seen_together(const MeasurementBatch& batch) {
  const auto at = [&](Index row) -> const Measurement& {
    return batch.measurements[static_cast<std::size_t>(row)];
  };
  std::vector<PoseGroup> groups;
  for (const PoseGroup& rows : pose_groups(batch)) {
    const auto first = std::ssize(groups);
    for (const Index row : rows) {
      const auto same = std::find_if(
          groups.begin() + first, groups.end(),
          [&](const PoseGroup& group) { return are_seen_together(at(group.front()), at(row)); });
      if (same == groups.end()) {
        groups.push_back({row});
      } else {
        same->push_back(row);
      }
    }
  }
  return groups;
}

std::vector<int> counted_together(const MeasurementBatch& batch) {
  const std::vector<PoseGroup> groups = groups_seen_together(batch);
  if (groups.size() == batch.measurements.size()) return {};
  std::vector<int> counts(batch.measurements.size(), 1);
  for (const PoseGroup& rows : groups) {
    for (const Index row : rows)
      counts[static_cast<std::size_t>(row)] = static_cast<int>(rows.size());
  }
  return counts;
}

}  // namespace trammel
