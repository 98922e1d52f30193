#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>

#include "server/base/mutex.h"

namespace trammel {

/// The names of participants that DDS-Security has let in: the subjects of their certificates. Thread-safe.
class ClientNames {
 public:
  using Time = std::chrono::steady_clock::time_point;
  /// Requests of a participant that has left are still carried out; its name is kept so long.
  static constexpr std::chrono::seconds kKept{30};

  /// What a participant says of itself, before it is let in. Only a name that fits its GUID counts.
  void announced(const std::string& participant, const std::string& claimed);
  void let_in(const std::string& participant);
  void refused(const std::string& participant);
  void left(const std::string& participant, Time now = std::chrono::steady_clock::now());

  /// Empty: it was not let in, or has no name that fits.
  [[nodiscard]] std::string of(const std::string& participant) const;

 private:
  struct Known {
    std::string name;
    bool is_in = false;
    std::optional<Time> left = {};
  };
  mutable Mutex mutex_;
  std::map<std::string, Known> known_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
