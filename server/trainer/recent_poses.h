#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/base/mutex.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// The newest 200 requested poses of a cell, where users would notice a change of models.
/// Thread-safe. Kept in memory only.
class RecentPoses {
 public:
  static constexpr std::size_t kMost = 200;

  void add(const std::string& cell, PoseContext pose);
  [[nodiscard]] std::vector<PoseContext> of(const std::string& cell) const;

 private:
  mutable Mutex mutex_;
  std::map<std::string, std::deque<PoseContext>> poses_ TRAMMEL_GUARDED_BY(mutex_);  // oldest first
};

/// m, the largest distance between the two predictions at one of these poses; empty if there is no
/// pose that both know.
[[nodiscard]] std::optional<double> farthest_step(const CompensatedModel& before,
                                                  const CompensatedModel& after,
                                                  const std::vector<PoseContext>& poses);

}  // namespace trammel
