#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "server/base/mutex.h"
#include "server/robot/cell_description.h"
#include "server/store/servers.h"
#include "server/trainer/served_cells.h"

namespace trammel {

/// The news from this server to the others, and from them to it. Thread-safe.
class Presence {
 public:
  /// Adds these cells to the announced ones.
  void describe(const ServedCells& cells) {
    std::map<std::string, CellDescription> more;
    for (const auto& [name, cell] : cells) more[name] = description_of(*cell);
    const MutexLock lock(mutex_);
    descriptions_.merge(more);
    has_news_ = true;
  }
  [[nodiscard]] std::map<std::string, CellDescription> descriptions() const {
    const MutexLock lock(mutex_);
    return descriptions_;
  }

  /// Records the number of changes of the record that are taken up.
  void has_followed(std::int64_t changes) {
    const MutexLock lock(mutex_);
    has_news_ = has_news_ || changes != followed_;
    followed_ = changes;
  }
  [[nodiscard]] std::int64_t followed() const {
    const MutexLock lock(mutex_);
    return followed_;
  }
  /// There is something to tell before the next heartbeat is due.
  void has_changed() {
    const MutexLock lock(mutex_);
    has_news_ = true;
  }

  void seen(std::vector<ServerInRecord> servers) {
    const MutexLock lock(mutex_);
    seen_ = std::move(servers);
  }
  [[nodiscard]] std::vector<ServerInRecord> seen() const {
    const MutexLock lock(mutex_);
    return seen_;
  }

  /// Returns a second later if there is news by then, else when the heartbeat is due; or when
  /// `stop` is requested.
  void wait(const std::stop_token& stop, std::chrono::steady_clock::time_point due) {
    constexpr std::chrono::seconds kSoonest{1};
    Condition never;
    MutexLock lock(mutex_);
    do {
      const auto tick = std::min(due, std::chrono::steady_clock::now() + kSoonest);
      never.wait_until(lock, stop, tick, [] { return false; });
    } while (!stop.stop_requested() && !has_news_ && std::chrono::steady_clock::now() < due);
    has_news_ = false;
  }

 private:
  mutable Mutex mutex_;
  std::map<std::string, CellDescription> descriptions_ TRAMMEL_GUARDED_BY(mutex_);  // by cell
  std::int64_t followed_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  bool has_news_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::vector<ServerInRecord> seen_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
