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
  /// The server still carries out requests of a participant that has left. It keeps the name for
  /// this time.
  static constexpr std::chrono::seconds kKept{30};
  /// The number of participants whose unverified claims are kept at once.
  static constexpr std::size_t kClaims = 4096;

  /// Records the claims of a participant before it is admitted. Only a name that matches its GUID
  /// counts. `address`: the address that it announces.
  void announced(const std::string& participant, const std::string& claimed,
                 const std::string& address = "");
  void let_in(const std::string& participant);
  /// What the participant claims to be, which nobody could confirm: `says it is CN=anna,O=Works, at
  /// 10.1.0.7`.
  std::string refused(const std::string& participant);
  /// A client of a gateway in this process, which has found out its name.
  void called(const std::string& participant, const std::string& name);
  void left(const std::string& participant, Time now = std::chrono::steady_clock::now());

  /// Empty: it was not admitted, or its name does not match.
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
