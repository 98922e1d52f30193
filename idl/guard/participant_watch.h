#pragma once

#include <cstdint>
#include <optional>

#include "idl/guard/dropped.h"
#include "idl/guard/recent_table.h"

namespace trammel::wire {

/// Who has announced itself lately, and from which socket. The library keeps each participant until its lease is over,
/// and a participant's name is a free invention of the sender; its socket is not. A socket may have several
/// participants, and a participant several sockets.
class ParticipantWatch {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr int kNewOfOneSocket = 16;  ///< in kWindow
  static constexpr std::chrono::seconds kWindow{10};
  static constexpr double kNewAtOnce = 2000;  ///< of all sockets
  static constexpr double kNewPerSecond = 200;

  [[nodiscard]] std::optional<Dropped> announced(Bytes prefix, std::uint64_t socket, Time now);

 private:
  struct Known {
    bool known = false;
  };
  struct Socket {
    Time since{};
    int participants = 0;
  };
  bool may_be_new(Time now);

  RecentTable<Known, 512> participants_;
  RecentTable<Socket, 512> sockets_;
  double allowed_ = kNewAtOnce;
  Time refilled_{};
};

}  // namespace trammel::wire
