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

/// Poses that a cell was lately asked for, the newest 200: where a change of models would be felt.
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

/// m, the farthest that the predictions of the two are apart at one of these poses; empty where
/// there is none that both know.
[[nodiscard]] std::optional<double> farthest_step(const CompensatedModel& before,
                                                  const CompensatedModel& after,
                                                  const std::vector<PoseContext>& poses);

}  // namespace trammel
