// Who hears the HEARTBEATs of discovery that the others are spared.
#include "idl/repairs/askers.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/rtps_packet.h"

namespace trammel::wire {
namespace {

using std::chrono::milliseconds;
using test::Packet;
using test::Prefix;

constexpr Prefix kSelf = {1, 15, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11},
                 kResident = {1, 15, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9},
                 kNewcomer = {1, 15, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8};
constexpr std::uint32_t kPublications = 0x000003c2, kSubscriptions = 0x000004c2,
                        kTheirReader = 0x000003c7;
constexpr std::uint16_t kOfResident = 2001, kOfNewcomer = 2002;  // UDP ports

std::uint64_t socket_at(std::uint16_t port) { return std::uint64_t{port} << 32 | 0x7f000001u; }

TEST(Askers, WhoAsksForEndpointsIsKnownByTheNumbersThatItLacks) {
  const auto asks = [](std::uint32_t writer, std::uint32_t bits) {
    return asks_for_endpoints(
        Packet(kNewcomer).to(kSelf).acknack(kTheirReader, writer, 3, bits, 1).bytes());
  };
  EXPECT_TRUE(asks(kPublications, 1));
  EXPECT_TRUE(asks(kSubscriptions, 256));
  EXPECT_FALSE(asks(kPublications, 0)) << "it confirms";
  EXPECT_FALSE(asks(0x00000103, 1)) << "of a writer of ours";
  EXPECT_FALSE(asks_for_endpoints({}));
}

TEST(Askers, WhoAskedIsToldMoreForASecondAndOthersAreNot) {
  const Askers::Time start = std::chrono::hours(1);
  Askers askers;
  askers.asks(kNewcomer, start);
  EXPECT_TRUE(askers.sockets(start).empty()) << "nobody knows where it listens";
  askers.announced(kNewcomer, {socket_at(kOfNewcomer)}, start);
  askers.announced(kResident, {socket_at(kOfResident)}, start);
  EXPECT_TRUE(askers.sockets(start).empty());
  askers.asks(kNewcomer, start);
  askers.announced(kNewcomer, {socket_at(kOfNewcomer)}, start + milliseconds(200));
  EXPECT_EQ(askers.sockets(start + milliseconds(999)),
            std::vector<std::uint64_t>{socket_at(kOfNewcomer)});
  EXPECT_TRUE(askers.sockets(start + Askers::kAsks).empty());
}

TEST(Askers, AThousandThatOnlyAnnounceThemselvesTakeNoNewcomersPlace) {
  const Askers::Time start = std::chrono::hours(1);
  Askers askers;
  askers.announced(kNewcomer, {socket_at(kOfNewcomer)}, start);
  askers.asks(kNewcomer, start);
  for (unsigned i = 0; i < 2 * Askers::kMost; ++i) {
    Prefix invented = kResident;
    invented[10] = static_cast<unsigned char>(i / 256);
    invented[11] = static_cast<unsigned char>(i % 256);
    askers.announced(invented, {socket_at(kOfResident)}, start);
  }
  EXPECT_EQ(askers.sockets(start), std::vector<std::uint64_t>{socket_at(kOfNewcomer)});
}

}  // namespace
}  // namespace trammel::wire
