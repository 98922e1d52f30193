#include "server/measurement/pose_groups.h"

#include <cmath>
#include <map>

namespace trammel {
namespace {

using Eigen::Index;

constexpr double kSameJoints = 1e-6;  // rad, m: as repeats are told

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

}  // namespace trammel
