#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "idl/repairs/guard/dropped.h"
#include "idl/repairs/guard/edited_message.h"
#include "idl/repairs/guard/rtps_bytes.h"

namespace trammel::wire {

/// Inline QoS at the front of `rest`, which is shortened by it. `names_source`: a key hash is an
/// endpoint's GUID and must be of `source` (empty: of anybody).
[[nodiscard]] std::optional<Dropped> check_inline_qos(Reader& rest, Bytes source, bool names_source,
                                                      bool& says_status);

inline constexpr std::uint32_t kLongestLeaseSeconds = 120;
inline constexpr std::uint32_t kUsualLeaseSeconds = 100;  // RTPS 2.2, table 9.12

/// The sockets (address and port) that an announcement names.
class NamedSockets {
 public:
  static constexpr std::size_t kMost = 16;
  /// False: there is no room.
  bool add(std::uint64_t socket) {
    if (count_ == kMost) return false;
    sockets_[count_++] = socket;
    return true;
  }
  [[nodiscard]] std::span<const std::uint64_t> all() const { return {sockets_.data(), count_}; }
  [[nodiscard]] bool has(std::uint64_t socket) const {
    return std::find(all().begin(), all().end(), socket) != all().end();
  }

 private:
  std::array<std::uint64_t, kMost> sockets_{};
  std::size_t count_ = 0;
};

/// The sockets at which an announcement says its sender can be reached, and for how long.
struct Reachable {
  std::uint32_t lease_seconds = kUsualLeaseSeconds;  ///< kLongestLeaseSeconds at most
  Bytes lease{};                                     ///< where it stands; empty: none is said
  bool little_endian = true;
  NamedSockets sockets{};
  std::array<Bytes, NamedSockets::kMost>
      stands{};  ///< where the id of each of the sockets' parameters stands
  std::optional<std::uint32_t> endpoint{};  ///< its entity id, the first octet the highest
};

/// The payload of a participant's, writer's or reader's announcement by `source`: each length and
/// count within its parameter, GUIDs of `source` (empty: of anybody). Parameters that only this
/// library reads, that nobody here needs and whose parsers trust what they read (type objects,
/// content filters) are blanked in `message`, and so are locators beyond the first
/// NamedSockets::kMost. Leases are cut to kLongestLeaseSeconds.
[[nodiscard]] std::optional<Dropped> check_announcement(Bytes payload, Bytes source,
                                                        EditedMessage& message,
                                                        Reachable& reachable);

/// The GUID that the inline QoS say is meant. Empty: none.
[[nodiscard]] std::optional<Bytes> guid_in_inline_qos(Reader inline_qos);
/// The GUID in the key of a participant or endpoint that has gone: a list of parameters. Empty:
/// there is none.
[[nodiscard]] std::optional<Bytes> guid_in_key(Bytes key);

/// The payload of a message of the authentication handshake, which comes before anybody is known.
/// It is of `source`, and so is the announcement within: the library compares that with the
/// certificate, and not with who speaks.
[[nodiscard]] std::optional<Dropped> check_handshake(Bytes payload, Bytes source);

}  // namespace trammel::wire
