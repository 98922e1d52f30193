#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "tests/support/raw_participant.h"

namespace trammel::test {

/// Sends changed copies of real packets to a participant: its own packets, sent back, and those
/// that a client sends to join.
class MutatedPackets {
 public:
  MutatedPackets(std::uint16_t port, std::uint32_t domain, unsigned seed);

  /// Joins, and collects the packets of the other one meanwhile. False if it does not answer.
  [[nodiscard]] bool collect();
  /// Sends that many packets; after each 500 it waits until they have been read.
  void send(std::size_t packets);

 private:
  [[nodiscard]] PacketBytes mutated();
  void add(PacketBytes packet);
  void wait_until_read();

  RawParticipant participant_;
  std::mt19937 random_;
  std::vector<PacketBytes> corpus_;
  std::uint32_t pings_ = 0;
};

}  // namespace trammel::test
