#pragma once

#include <cstdint>
#include <optional>

#include "idl/guard/dropped.h"
#include "idl/guard/recent_table.h"

namespace trammel::wire {

/// Who has announced itself, and from which socket. The library keeps each participant until its lease is over, and
/// each one costs it time for every other: with thousands it falls behind, and nobody new is heard. A participant's
/// name is a free invention of the sender; its socket is not. A socket may have several participants, and a participant
/// several sockets.
class ParticipantWatch {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr int kNewOfOneSocket = 16;  ///< in kWindow
  static constexpr std::chrono::seconds kWindow{10};
  static constexpr double kNewAtOnce = 1000;  ///< of all sockets
  static constexpr double kNewPerSecond = 50;
  static constexpr std::size_t kMost = 1500;  ///< whose leases are not over
  /// With more than these, only who announces itself again is heard: whoever stays does.
  static constexpr std::size_t kCrowd = 512;

  [[nodiscard]] std::optional<Dropped> announced(Bytes prefix, std::uint64_t socket, std::chrono::seconds lease,
                                                 Time now);
  void left(Bytes prefix);

 private:
  struct Participant {
    Time until{};  ///< its lease is over
  };
  struct Socket {
    Time since{};
    int participants = 0;
  };
  struct Stranger {
    bool seen = false;
  };
  [[nodiscard]] bool has_room(const EndpointKey& key, Time now);
  [[nodiscard]] bool may_be_new(Time now);

  RecentTable<Participant, 512> participants_;
  RecentTable<Stranger, 512> strangers_;
  RecentTable<Socket, 512> sockets_;
  double allowed_ = kNewAtOnce;
  Time refilled_{};
};

}  // namespace trammel::wire
