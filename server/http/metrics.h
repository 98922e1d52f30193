#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "server/base/mutex.h"
#include "server/http/watched.h"

namespace trammel {

/// The figures that Prometheus scrapes: README.md of this folder lists every name. Thread-safe.
class Metrics {
 public:
  explicit Metrics(const Watched& server) : server_(server) {}

  /// A job is over; others are not counted.
  void job_changed(const JobProgress& job);
  /// The figures in Prometheus' text format. `shed`: requests for pages that were rejected. Before
  /// it serves, only those of the process.
  [[nodiscard]] std::string text(ServerPhase phase, std::uint64_t shed);

 private:
  /// When a version was made, and its newest measurement taken: Unix time, s.
  struct Stamp {
    int version = 0;
    std::int64_t trained_at = 0;
    std::optional<std::int64_t> measured_at;
  };
  /// The stamps of each cell's model in force, as far as they are known. It learns those of models
  /// in memory, and asks the store about a few others.
  [[nodiscard]] std::map<std::string, Stamp> stamps();

  const Watched& server_;
  Mutex mutex_;
  std::map<std::string, Stamp> stamps_ TRAMMEL_GUARDED_BY(mutex_);         // by cell
  std::map<std::string, std::uint64_t> ended_ TRAMMEL_GUARDED_BY(mutex_);  // jobs, by verdict
};

}  // namespace trammel
