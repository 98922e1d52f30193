#include "server/trainer/recent_poses.h"

#include <algorithm>
#include <utility>

#include "server/compensate/known_rows.h"

namespace trammel {

void RecentPoses::add(const std::string& cell, PoseContext pose) {
  const MutexLock lock(mutex_);
  std::deque<PoseContext>& poses = poses_[cell];
  poses.push_back(std::move(pose));
  if (poses.size() > kMost) poses.pop_front();
}

std::vector<PoseContext> RecentPoses::of(const std::string& cell) const {
  const MutexLock lock(mutex_);
  const auto poses = poses_.find(cell);
  if (poses == poses_.end()) return {};
  return {poses->second.begin(), poses->second.end()};
}

std::optional<double> farthest_step(const CompensatedModel& before, const CompensatedModel& after,
                                    const std::vector<PoseContext>& poses) {
  std::vector<PoseContext> known;
  for (const PoseContext& pose : poses) {
    Measurement asked;
    asked.context = pose;
    if (knows(before, asked) && knows(after, asked)) known.push_back(pose);
  }
  if (known.empty()) return std::nullopt;
  const std::vector<ErrorPrediction> old = before.predict_all(known),
                                     now = after.predict_all(known);
  double farthest = 0;
  for (std::size_t i = 0; i < known.size(); ++i) {
    const Vector3 step = now[i].X_BT_predicted.translation() - old[i].X_BT_predicted.translation();
    farthest = std::max(farthest, step.norm());
  }
  return farthest;
}

}  // namespace trammel
