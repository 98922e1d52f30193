#pragma once

#include <cstdint>
#include <optional>

#include "idl/guard/dropped.h"
#include "idl/guard/edited_message.h"
#include "idl/guard/rtps_bytes.h"

namespace trammel::wire {

/// Inline QoS at the front of `rest`, which is shortened by it. `names_source`: a key hash is an endpoint's GUID and
/// must be of `source` (empty: of anybody).
[[nodiscard]] std::optional<Dropped> check_inline_qos(Reader& rest, Bytes source, bool names_source, bool& says_status);

/// The payload of a participant's, writer's or reader's announcement by `source`: each length and count within its
/// parameter, GUIDs of `source` (empty: of anybody). Parameters that only this library reads, that nobody here needs
/// and whose parsers trust what they read (type objects, content filters) are blanked in `message`. Leases are cut to
/// kLongestLeaseSeconds; `lease_seconds` is the one that is left, kUsualLeaseSeconds where none is said.
[[nodiscard]] std::optional<Dropped> check_announcement(Bytes payload, Bytes source, EditedMessage& message,
                                                        std::uint32_t& lease_seconds);

/// The payload of a message of the authentication handshake, which comes before anybody is known. It is of `source`,
/// and so is the announcement within: the library compares that with the certificate, and not with who speaks.
[[nodiscard]] std::optional<Dropped> check_handshake(Bytes payload, Bytes source);

inline constexpr std::uint32_t kLongestLeaseSeconds = 120;
inline constexpr std::uint32_t kUsualLeaseSeconds = 100;  // RTPS 2.2, table 9.12

}  // namespace trammel::wire
