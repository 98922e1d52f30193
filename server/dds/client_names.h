#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>

#include "server/base/mutex.h"

namespace trammel {

/// The names of participants that DDS-Security has let in: the subjects of their certificates.
/// Thread-safe.
class ClientNames {
 public:
  using Time = std::chrono::steady_clock::time_point;
  /// Requests of a participant that has left are still carried out; its name is kept so long.
  static constexpr std::chrono::seconds kKept{30};
  /// The number of participants whose claims are kept at once, where these are no names that fit.
  static constexpr std::size_t kClaims = 4096;

  /// Notes what a participant says of itself, before it is let in. Only a name that fits its GUID
  /// counts. `address`: where it says that it can be reached.
  void announced(const std::string& participant, const std::string& claimed,
                 const std::string& address = "");
  void let_in(const std::string& participant);
  /// The claim of the participant about itself, which nobody could confirm: `says it is
  /// CN=anna,O=Works, at 10.1.0.7`.
  std::string refused(const std::string& participant);
  void left(const std::string& participant, Time now = std::chrono::steady_clock::now());

  /// Empty: it was not let in, or has no name that fits.
  [[nodiscard]] std::string of(const std::string& participant) const;

 private:
  struct Known {
    std::string name;
    std::string claim = {};
    bool is_in = false;
    std::optional<Time> left = {};
  };
  mutable Mutex mutex_;
  std::map<std::string, Known> known_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
