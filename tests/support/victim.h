#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace trammel::test {

/// A participant with a reader of "Topic" in a process of its own, for packets that may end it.
/// Limited in memory and processor time.
class Victim {
 public:
  static constexpr std::uint32_t kDomain = 41;

  /// `guarded`: as every participant of ours is. Without the guard: as the library is.
  explicit Victim(bool guarded);
  ~Victim();  ///< ends it
  Victim(const Victim&) = delete;
  Victim& operator=(const Victim&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// It has ended by itself.
  [[nodiscard]] bool is_dead();
  /// Somebody new is answered within `limit`, and its writer is known to the reader.
  [[nodiscard]] bool answers(std::chrono::milliseconds limit) const;
  /// The most memory that it has used, MiB.
  [[nodiscard]] std::size_t peak_mib() const;

 private:
  std::uint16_t port_;
  pid_t process_;
  bool ended_ = false;
};

}  // namespace trammel::test
