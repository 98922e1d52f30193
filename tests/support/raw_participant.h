#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "tests/support/rtps_packet.h"

namespace trammel::test {

inline constexpr std::uint32_t kAnnouncerId = 0x000100c2, kPublicationsId = 0x000003c2,
                               kSubscriptionsId = 0x000004c2;
inline constexpr std::uint32_t kAnnouncerReader = 0x000100c7, kPublicationsReader = 0x000003c7,
                               kSubscriptionsReader = 0x000004c7;

/// A participant without any DDS library: one UDP socket, through which a test sends arbitrary
/// packets.
class RawParticipant {
 public:
  /// `port` of 127.0.0.1 is where the other one listens.
  explicit RawParticipant(std::uint16_t port, std::uint32_t domain, unsigned seed = 1);
  ~RawParticipant();
  RawParticipant(const RawParticipant&) = delete;
  RawParticipant& operator=(const RawParticipant&) = delete;

  [[nodiscard]] const Prefix& prefix() const { return prefix_; }
  void set_prefix(const Prefix& prefix) { prefix_ = prefix; }
  [[nodiscard]] std::uint16_t own_port() const { return own_port_; }
  /// The peer that answered an announcement.
  [[nodiscard]] const Prefix& peer() const { return peer_; }
  /// A message from this participant to the peer.
  [[nodiscard]] Packet packet() const { return Packet(prefix_).to(peer_); }

  /// Parameters of an announcement that is complete.
  [[nodiscard]] ParameterList announcement() const;
  /// The parameters of a reliable endpoint without key.
  [[nodiscard]] ParameterList endpoint(std::uint32_t entity, const std::string& topic,
                                       const std::string& type) const;
  /// Announces itself until the other one's announcement comes, at most `limit`.
  [[nodiscard]] bool meet(std::chrono::milliseconds limit);
  /// Becomes a writer of "Topic" of "Type" that a reader of the peer knows; call it after meet().
  [[nodiscard]] bool become_writer(std::uint32_t entity, std::chrono::milliseconds limit) const;
  /// Sends a message to the port for announcements, and to the port for data if it is known.
  void send(const PacketBytes& message) const;
  void send_data(const PacketBytes& message) const;
  [[nodiscard]] std::optional<PacketBytes> receive(std::chrono::milliseconds limit) const;
  /// Receives until `wanted` is true of a message.
  [[nodiscard]] bool wait_for(const std::function<bool(const PacketBytes&)>& wanted,
                              std::chrono::milliseconds limit) const;

 private:
  void send_to(std::uint16_t port, const PacketBytes& message) const;
  bool learn(const PacketBytes& message);

  std::uint16_t port_, data_port_ = 0, own_port_ = 0;
  std::uint32_t domain_;
  int socket_;
  Prefix prefix_{}, peer_{};
};

/// Calls `found(id, flags, body)` for each submessage until it returns true.
bool any_submessage(
    const PacketBytes& message,
    const std::function<bool(unsigned char, unsigned char, const PacketBytes&)>& found);

}  // namespace trammel::test
