// Repetitions of the library to everybody leave only as far as they say something.
#include "idl/repairs/heartbeat_pace.h"

#include <gtest/gtest.h>

#include "tests/support/rtps_packet.h"

namespace trammel::wire {
namespace {

using std::chrono::milliseconds;
using test::Packet;
using test::Prefix;

constexpr Prefix kSelf = {1, 15, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11},
                 kPacedOther = {1, 15, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9};
constexpr std::uint32_t kPacedPublications = 0x000003c2, kPacedSubscriptions = 0x000004c2,
                        kTheirReader = 0x000003c7;
constexpr std::uint32_t kPacedUserReader = 0x00000104, kPacedUserWriter = 0x00000103;
const HeartbeatPace::Time kStart{std::chrono::hours(1)};

Packet offer(std::uint32_t writer) {
  return Packet(kSelf).heartbeat(kTheirReader, writer, 1, 9, 1);
}

TEST(HeartbeatPace, DiscoveryTellsEverybodyItsNumbersOnceInTwentyMilliseconds) {
  HeartbeatPace pace;
  int left = 0;
  for (int ms = 0; ms < 1000; ++ms) {
    left += pace.lets_out(offer(kPacedPublications).bytes(), kStart + milliseconds(ms)) ? 1 : 0;
  }
  EXPECT_EQ(left, 50);
}

TEST(HeartbeatPace, WhatTheLibraryAppendsForItsStatisticsChangesNothing) {
  HeartbeatPace pace;
  const auto message =
      offer(kPacedPublications).submessage(kStatistics, 1, test::PacketBytes(56)).bytes();
  EXPECT_TRUE(pace.lets_out(message, kStart));
  EXPECT_FALSE(pace.lets_out(message, kStart + milliseconds(1)));
}

TEST(HeartbeatPace, WritersAndReadersAreToldOfApart) {
  HeartbeatPace pace;
  EXPECT_TRUE(pace.lets_out(offer(kPacedPublications).bytes(), kStart));
  EXPECT_TRUE(pace.lets_out(offer(kPacedSubscriptions).bytes(), kStart));
  EXPECT_FALSE(pace.lets_out(offer(kPacedSubscriptions).bytes(), kStart + milliseconds(1)));
}

TEST(HeartbeatPace, WhatIsForOneParticipantLeavesAtOnce) {
  HeartbeatPace pace;
  for (int i = 0; i < 3; ++i) {
    const auto message =
        Packet(kSelf).to(kPacedOther).heartbeat(kTheirReader, kPacedPublications, 1, 9, 1).bytes();
    EXPECT_TRUE(pace.lets_out(message, kStart));
  }
}

TEST(HeartbeatPace, AWriterThatOffersNothingIsAskedMoreAndMoreSeldom) {
  HeartbeatPace pace;
  const auto question = [](const Prefix& of, std::uint32_t writer) {
    return Packet(kSelf).to(of).acknack(kPacedUserReader, writer, 0, 0, 1).bytes();
  };
  int left = 0;
  for (int ms = 0; ms < 10'000; ++ms) {
    left +=
        pace.lets_out(question(kPacedOther, kPacedUserWriter), kStart + milliseconds(ms)) ? 1 : 0;
  }
  EXPECT_LE(left, 15);
  EXPECT_GE(left, 10);
  const auto now = kStart + milliseconds(10'000);
  EXPECT_TRUE(pace.lets_out(question(kPacedOther, kPacedUserWriter), now + milliseconds(1500)))
      << "it is met again";
  EXPECT_TRUE(pace.lets_out(question(kSelf, kPacedUserWriter), now))
      << "a writer of the same name elsewhere";
  EXPECT_TRUE(pace.lets_out(question(kPacedOther, kPacedUserWriter + 0x100), now));
  EXPECT_TRUE(pace.lets_out(
      Packet(kSelf).to(kPacedOther).acknack(kPacedUserReader, kPacedUserWriter, 1, 0, 1).bytes(),
      now));
  EXPECT_TRUE(pace.lets_out(
      Packet(kSelf).to(kPacedOther).acknack(kPacedUserReader, kPacedUserWriter, 0, 8, 1).bytes(),
      now));
}

/// The number of messages that leave of an offer that is made every 10 ms for so long.
int offered(HeartbeatPace& pace, HeartbeatPace::Time from, int milliseconds_long) {
  int left = 0;
  for (int ms = 0; ms < milliseconds_long; ms += 10) {
    const auto message = Packet(kSelf)
                             .to(kPacedOther)
                             .heartbeat(kPacedUserReader, kPacedUserWriter, 1, 9, 1)
                             .bytes();
    left += pace.lets_out(message, from + milliseconds(ms)) ? 1 : 0;
  }
  return left;
}

TEST(HeartbeatPace, AReaderThatNeverConfirmsIsToldFiveTimesASecond) {
  HeartbeatPace pace;
  EXPECT_EQ(offered(pace, kStart, 500), 50) << "it may be slow, or the line may lose something";
  const auto then = kStart + milliseconds(500);
  const int left = offered(pace, then, 10'000);
  EXPECT_LE(left, 51);
  EXPECT_GE(left, 49);
  EXPECT_EQ(offered(pace, then + milliseconds(12'000), 100), 10)
      << "something new is to be confirmed";
}

TEST(HeartbeatPace, WhoAnswersIsOfferedAtOnceWhatItLacks) {
  HeartbeatPace pace;
  static_cast<void>(offered(pace, kStart, 2000));
  const auto then = kStart + milliseconds(2000);
  pace.heard(Packet(kSelf).to(kSelf).acknack(kPacedUserReader, kPacedUserWriter, 1, 8, 1).bytes(),
             then);
  EXPECT_LT(offered(pace, then, 300), 10) << "somebody else answers";
  pace.heard(
      Packet(kPacedOther).to(kSelf).acknack(kPacedUserReader, kPacedUserWriter, 1, 8, 1).bytes(),
      then + milliseconds(300));
  EXPECT_EQ(offered(pace, then + milliseconds(300), 400), 40);
  pace.heard(
      Packet(kPacedOther).to(kSelf).nack_frag(kPacedUserReader, kPacedUserWriter, 1, 1, 1).bytes(),
      then + milliseconds(700));
  EXPECT_EQ(offered(pace, then + milliseconds(700), 400), 40);
  pace.heard({}, then);
}

TEST(HeartbeatPace, WhatHoldsDataOrIsOfAnotherWriterLeavesAtOnce) {
  HeartbeatPace pace;
  for (int i = 0; i < 3; ++i) {
    test::DataFields data;
    data.writer = kPacedPublications;
    EXPECT_TRUE(pace.lets_out(offer(kPacedPublications).data(data).bytes(), kStart));
    EXPECT_TRUE(pace.lets_out(Packet(kSelf).data(data).bytes(), kStart));
    EXPECT_TRUE(pace.lets_out(
        Packet(kSelf).heartbeat(kPacedUserReader, kPacedUserWriter, 1, 9, 1).bytes(), kStart));
    EXPECT_TRUE(pace.lets_out(
        Packet(kSelf).acknack(kTheirReader, kPacedPublications, 1, 0, 1).bytes(), kStart));
    EXPECT_TRUE(pace.lets_out({}, kStart));
  }
}

}  // namespace
}  // namespace trammel::wire
