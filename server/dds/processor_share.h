#pragma once

#include <cstdint>

namespace trammel {

/// The share of the processor time that this process wanted and got. On a crowded machine its
/// threads wait for a processor, and that time is no sign of a hang. A thread that waits for a
/// lock, or for news, wants no processor time. Uses no heap and no lock, so that a watching thread
/// may call it. Not thread-safe.
class ProcessorShare {
 public:
  static constexpr double kLeast = 0.25;

  ProcessorShare() { static_cast<void>(since_last()); }

  /// kLeast to 1, since the last call; also 1 if the system does not report it.
  [[nodiscard]] double since_last();

 private:
  struct Times {
    std::uint64_t ran = 0, queued = 0;  // ns, of all threads
  };
  [[nodiscard]] static Times now();

  Times last_;
};

}  // namespace trammel
