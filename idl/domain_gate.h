#pragma once

#include <fastdds/rtps/transport/TransportDescriptorInterface.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

/// Keeps domains apart. Everybody finds everybody by a fixed port that knows nothing of domains, and Fast DDS 2.9 looks
/// at no domain either: so what a participant says of its own domain when it announces itself is read here, below the
/// library, and the announcement of another domain is dropped. Who was never announced is never heard.
namespace trammel::wire {

/// What a participant of ours puts into its user data: `trammel.domain=5`. Others may, and need not: DDS has a
/// parameter of its own for it (PID_DOMAIN_ID), which Cyclone and most others send and Fast DDS 2.9 does not.
[[nodiscard]] std::string domain_mark(std::uint32_t domain);

/// Whether an RTPS message holds the announcement of a participant that says to be of another domain. Never reads
/// beyond `message`, whatever it holds.
[[nodiscard]] bool is_of_another_domain(std::span<const unsigned char> message, std::uint32_t domain);

/// Whether it holds a participant's announcement at all.
[[nodiscard]] bool is_announcement(std::span<const unsigned char> message);

/// What a participant hears of itself, where it is among its own peers: a proof that the library's threads move.
struct HeardOfItself {
  std::atomic<std::uint64_t> announcements{0};  ///< dealt with by the thread that receives them
  /// Entity id of a reliable writer of its own, its first octet the highest; 0 for none. What it writes is lost on its
  /// first way back to the participant itself, at most twice a second: so that it comes only if what sends again moves.
  std::atomic<std::uint32_t> first_lost_of{0};
};

/// `below`, with the gate in front of it. `heard` may be null.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> with_domain_gate(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> below, std::uint32_t domain,
    std::shared_ptr<HeardOfItself> heard);

}  // namespace trammel::wire
