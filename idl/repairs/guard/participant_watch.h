#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "idl/repairs/guard/announcement_check.h"
#include "idl/repairs/guard/dropped.h"
#include "idl/repairs/guard/recent_table.h"

namespace trammel::wire {

/// Who has announced itself, and from which socket. The library keeps each participant until its
/// lease is over, and each one costs it time for every other: with thousands it falls behind,
/// nobody new is heard, and where many leases end together it stands still. It also sends to every
/// socket that an announcement names. A participant's name is a free invention of the sender, and
/// so are the sockets that it names; the socket that it sends from is not. So whoever has not
/// spoken to us yet is a stranger: strangers are few, their leases short, and little is sent to
/// them. A socket may have several participants, and a participant several sockets.
class ParticipantWatch {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr int kNewOfOneSocket = 16;  ///< in kWindow
  static constexpr std::chrono::seconds kWindow{10};
  static constexpr std::size_t kMost = 1500;  ///< whose leases are not over
  static constexpr double kStrangersAtOnce = 128;
  static constexpr double kStrangersPerSecond =
      10;  ///< more; a stranger who speaks to us makes room at once
  /// With more strangers than these, only who announces itself again is heard: whoever stays does.
  static constexpr std::size_t kCrowd = 32;
  static constexpr std::chrono::seconds kStrangersLease{10};
  static constexpr int kAnswers =
      4;  ///< datagrams that a stranger is sent for each of its announcements

  struct Admission {
    std::optional<Dropped> dropped;
    std::chrono::seconds lease{0};  ///< that the library may see
    bool ignored = false;           ///< as if it had not been sent
  };
  /// `pinned`: somebody known who says something else of itself than before is not heard.
  [[nodiscard]] Admission announced(Bytes prefix, std::uint64_t socket, const Reachable& reachable,
                                    bool pinned, Time now);
  /// It has sent something to us, by our name: it hears us.
  void spoke(Bytes prefix, Time now);
  void left(Bytes prefix);
  [[nodiscard]] bool is_there(Bytes prefix, Time now);
  /// True if the participant has announced that it listens there: its endpoints listen nowhere
  /// else.
  [[nodiscard]] bool listens_at(Bytes prefix, std::uint64_t socket, Time now);

  [[nodiscard]] bool knows_strangers() const { return !strangers_.empty(); }
  /// If true, a datagram may be sent there: not without end where a stranger alone says that it
  /// listens.
  [[nodiscard]] bool lets_out(std::uint64_t socket, Time now);

 private:
  struct Participant {
    Time until{};  ///< its lease is over
    bool is_stranger = true;
    std::uint64_t said = 0;  ///< a mix of its lease and its sockets
    NamedSockets sockets{};
  };
  struct Socket {
    Time since{};
    int participants = 0;
  };
  struct Listens {
    Time until{};  ///< of somebody who is no stranger
  };
  struct Seen {
    bool before = false;
  };
  struct Stranger {
    EndpointKey key;
    Time until{};
    int answers = 0;  ///< that are left
    NamedSockets sockets;
  };
  [[nodiscard]] bool has_room(const EndpointKey& key, Time now);
  [[nodiscard]] bool may_be_new(Time now);
  void hear_again(const EndpointKey& key, Participant& known, const Reachable& reachable, Time now);
  void forget_strangers(Time now);
  void forget_stranger(const EndpointKey& key);
  [[nodiscard]] Stranger* stranger(const EndpointKey& key);
  void note_sockets(const NamedSockets& sockets, Time now, Time until);

  RecentTable<Participant, 512> participants_;
  RecentTable<Seen, 512> seen_;
  RecentTable<Socket, 512> sockets_;
  RecentTable<Listens, 512> listens_;
  std::vector<Stranger> strangers_;
  double allowed_ = kStrangersAtOnce;
  Time refilled_{};
};

}  // namespace trammel::wire
