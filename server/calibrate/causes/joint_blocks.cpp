#include "server/calibrate/causes/joint_blocks.h"

#include <algorithm>

#include "server/measurement/pose_groups.h"

namespace trammel {

namespace {

constexpr int kHalvings = 3;  // seven eighths still show the physics

using Blocks = std::vector<std::vector<std::size_t>>;

/// Halves the poses along the joint in which they spread widest, and halves the parts in the same
/// way.
void halve(const MeasurementBatch& batch, std::vector<PoseGroup> poses, int times, Blocks& blocks) {
  const auto q_of = [&](const PoseGroup& pose) -> const JointVector& {
    return batch.measurements[static_cast<std::size_t>(pose.front())].context.q;
  };
  if (times == 0 || poses.size() < 2) {
    std::vector<std::size_t>& rows = blocks.emplace_back();
    for (const PoseGroup& pose : poses) rows.insert(rows.end(), pose.begin(), pose.end());
    std::sort(rows.begin(), rows.end());
    return;
  }
  Eigen::VectorXd lowest = q_of(poses.front()), highest = lowest;
  for (const PoseGroup& pose : poses) {
    lowest = lowest.cwiseMin(q_of(pose));
    highest = highest.cwiseMax(q_of(pose));
  }
  Eigen::Index widest = 0;
  (highest - lowest).maxCoeff(&widest);
  std::stable_sort(poses.begin(), poses.end(), [&](const PoseGroup& a, const PoseGroup& b) {
    return q_of(a)(widest) < q_of(b)(widest);
  });
  const auto middle = poses.begin() + static_cast<std::ptrdiff_t>(poses.size() / 2);
  halve(batch, {poses.begin(), middle}, times - 1, blocks);
  halve(batch, {middle, poses.end()}, times - 1, blocks);
}

}  // namespace

Blocks joint_blocks(const MeasurementBatch& batch) {
  Blocks blocks;
  halve(batch, pose_groups(batch), kHalvings, blocks);
  return blocks;
}

}  // namespace trammel
