#pragma once

#include <cstdint>

namespace trammel {

/// The share that this process was given of the processor time that it wanted. On a crowded machine
/// its threads stand in a queue; time that passes there says nothing of whether they hang. A thread
/// that waits for a lock, or for news, wants none. Uses no heap and no lock, so that a thread that
/// watches others may ask. Not thread-safe.
class ProcessorShare {
 public:
  static constexpr double kLeast = 0.25;

  ProcessorShare() { static_cast<void>(since_last()); }

  /// kLeast to 1, since the last call; 1 also where the system does not tell.
  [[nodiscard]] double since_last();

 private:
  struct Times {
    std::uint64_t ran = 0, queued = 0;  // ns, of all threads
  };
  [[nodiscard]] static Times now();

  Times last_;
};

}  // namespace trammel
