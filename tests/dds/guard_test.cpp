// The guard's answer to each kind of packet. The packets that harm the library itself are in
// tests/end_to_end/hostile_packets_test.cpp.
#include "idl/repairs/guard/guard.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <numeric>
#include <optional>
#include <random>
#include <vector>

#include "idl/limits.h"
#include "idl/repairs/guard/announcement_check.h"
#include "idl/repairs/guard/cut_sample.h"
#include "tests/support/rtps_packet.h"

namespace trammel::wire {
namespace {

using test::Packet;
using test::PacketBytes;
using test::ParameterList;
using test::Prefix;

constexpr Prefix kSource = {1, 15, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11},
                 kOther = {1, 15, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9};
constexpr std::uint32_t kPublications = 0x000003c2, kSubscriptions = 0x000004c2;
constexpr std::uint32_t kUserWriter = 0x00000103, kUserReader = 0x00000104;
/// A socket of 127.0.0.1, as the guard numbers it.
constexpr std::uint64_t loopback(std::uint16_t port) {
  return std::uint64_t{port} << 32 | 0x7f000001u;
}
constexpr std::uint64_t kSocket = loopback(4711), kOtherSocket = loopback(4712);
const PacketBytes kSample = {0, 1, 0, 0, 1, 2, 3, 4};

/// Why the guard drops it; empty: it passes.
std::optional<Dropped> fate(Guard& guard, const PacketBytes& message) {
  std::vector<std::uint64_t> before;
  for (std::size_t i = 0; i < kDroppedReasons; ++i)
    before.push_back(guard.counts().of(static_cast<Dropped>(i)));
  if (guard.check(message, kSocket)) return std::nullopt;
  for (std::size_t i = 0; i < kDroppedReasons; ++i) {
    if (guard.counts().of(static_cast<Dropped>(i)) == before[i] + 1) return static_cast<Dropped>(i);
  }
  ADD_FAILURE() << "dropped without a reason";
  return std::nullopt;
}
std::optional<Dropped> fate(const PacketBytes& message) {
  Guard guard(kMaxTextSample);
  return fate(guard, message);
}
constexpr std::optional<Dropped> kPasses;

Packet from() { return Packet(kSource); }
/// The value of a lease.
PacketBytes lasting(std::uint32_t seconds, std::uint32_t fraction = 0) {
  PacketBytes lease;
  test::put32(lease, seconds);
  test::put32(lease, fraction);
  return lease;
}
ParameterList participant(std::uint32_t lease_s = 10) {
  return ParameterList()
      .add(0x0015, {2, 3, 0, 0})
      .guid(0x0050, kSource, 0x000001c1)
      .text(0x0062, "somebody")
      .add(0x0002, lasting(lease_s));
}
ParameterList writer() {
  return ParameterList()
      .guid(0x005a, kSource, kUserWriter)
      .text(0x0005, "Topic")
      .text(0x0007, "Type");
}
PacketBytes announcement(const ParameterList& list, std::uint32_t by = kAnnouncer) {
  return from().data({0, by, 1, {}, list.payload()}).bytes();
}
/// A list with one more parameter, whose value is so many words.
PacketBytes with(std::uint16_t id, const std::vector<std::uint32_t>& words,
                 std::uint32_t by = kPublications) {
  PacketBytes value;
  for (const std::uint32_t word : words) test::put32(value, word);
  return announcement(writer().add(id, value), by);
}

TEST(Guard, WhatHonestParticipantsSendPasses) {
  Guard guard(kMaxTextSample);
  EXPECT_EQ(fate(guard, announcement(participant())), kPasses);
  EXPECT_EQ(fate(guard, announcement(writer(), kPublications)), kPasses);
  EXPECT_EQ(fate(guard, announcement(writer(), kSubscriptions)), kPasses);
  EXPECT_EQ(
      fate(
          guard,
          from().data({0, kUserWriter, 1, {}, kSample}).heartbeat(0, kUserWriter, 1, 1, 1).bytes()),
      kPasses);
  EXPECT_EQ(fate(guard, from().to(kOther).heartbeat(0, kUserWriter, 1, 0, 2).bytes()), kPasses)
      << "nothing sent yet";
  EXPECT_EQ(fate(guard, from().gap(0, kUserWriter, 2, 9).bytes()), kPasses);
  EXPECT_EQ(fate(guard, from().acknack(kUserReader, kUserWriter, 0, 0, 1).bytes()), kPasses)
      << "before any";
  EXPECT_EQ(fate(guard, from().acknack(kUserReader, kUserWriter, 7, 256, 2).bytes()), kPasses);
  EXPECT_EQ(
      fate(guard,
           from().fragments({0, kUserWriter, 9, 1, 2, 1024, 4096, PacketBytes(2048)}).bytes()),
      kPasses);
  EXPECT_EQ(fate(guard, from().submessage(0x09, 1, PacketBytes(8)).submessage(0x01, 1, {}).bytes()),
            kPasses);
  const PacketBytes leaves =
      ParameterList().guid(0x0070, kSource, 0x000001c1).add(0x0071, {0, 0, 0, 3}).bytes();
  EXPECT_EQ(fate(guard, from().data({0, kAnnouncer, 2, leaves, {}}).bytes()), kPasses)
      << "it leaves";
}

TEST(Guard, WhatIsNoRtpsMessageIsDropped) {
  EXPECT_EQ(fate({}), Dropped::kHeader);
  EXPECT_EQ(fate(PacketBytes(19, 'R')), Dropped::kHeader);
  PacketBytes other = from().data({0, kUserWriter, 1, {}, kSample}).bytes();
  other[4] = 1;
  EXPECT_EQ(fate(other), Dropped::kHeader) << "version 1";
  EXPECT_EQ(fate(Packet(Prefix{}).data({0, kUserWriter, 1, {}, kSample}).bytes()),
            Dropped::kSource);
}

TEST(Guard, SubmessagesThatDoNotFitAreDropped) {
  const PacketBytes data = from().data({0, kUserWriter, 1, {}, kSample}).bytes();
  for (std::size_t size = kHeaderBytes + 1; size < data.size(); ++size) {
    EXPECT_EQ(fate(PacketBytes(data.begin(), data.begin() + static_cast<std::ptrdiff_t>(size))),
              Dropped::kLength)
        << size << " of " << data.size() << " bytes";
  }
  PacketBytes odd = from().submessage(0x01, 1, PacketBytes(3)).bytes();
  test::put_bytes(odd, {0x01, 1, 0, 0});
  EXPECT_EQ(fate(odd), Dropped::kLength) << "the library would go on at another place";
  EXPECT_EQ(fate(from().data({0, kUserWriter, 1, {}, {}}).bytes()), Dropped::kLength)
      << "neither data nor state";
  PacketBytes both = data;
  both[kHeaderBytes + 1] |= kKey;
  EXPECT_EQ(fate(both), Dropped::kLength) << "data and key at once";
  PacketBytes jump = data;
  jump[kHeaderBytes + 6] = 0xf0;  // octets to inline QoS
  jump[kHeaderBytes + 7] = 0xff;
  EXPECT_EQ(fate(jump), Dropped::kLength);
}

TEST(Guard, AStatisticsSubmessagePassesNowhere) {
  const auto with_statistics = [](std::size_t size, bool last) {
    Packet packet = from().data({0, kUserWriter, 1, {}, kSample});
    packet.submessage(kStatistics, 1, PacketBytes(size));
    if (!last) packet.submessage(0x01, 1, {});
    return packet.bytes();
  };
  EXPECT_EQ(fate(with_statistics(56, false)), Dropped::kStatistics);
  EXPECT_EQ(fate(with_statistics(52, true)), Dropped::kStatistics);
  Guard guard(kMaxTextSample);
  const PacketBytes honest = with_statistics(56, true);
  const auto passed = guard.check(honest, kSocket);
  ASSERT_TRUE(passed);
  EXPECT_EQ(PacketBytes(passed->begin(), passed->end()),
            from().data({0, kUserWriter, 1, {}, kSample}).bytes())
      << "without it";
}

TEST(Guard, NobodySpeaksInTheNameOfAnother) {
  EXPECT_EQ(fate(announcement(ParameterList().guid(0x0050, kOther, 0x000001c1))), Dropped::kSource);
  EXPECT_EQ(fate(announcement(ParameterList().guid(0x005a, kOther, kUserWriter), kPublications)),
            Dropped::kSource);
  const PacketBytes ends_another =
      ParameterList().guid(0x0070, kOther, 0x000001c1).add(0x0071, {0, 0, 0, 3}).bytes();
  EXPECT_EQ(fate(from().data({0, kAnnouncer, 2, ends_another, {}}).bytes()), Dropped::kSource);
  EXPECT_EQ(fate(from().submessage(kInfoSource, 1, PacketBytes(20)).bytes()), Dropped::kSource);
}

TEST(Guard, NumbersThatNoWriterReachesAreDropped) {
  constexpr std::int64_t kHuge = std::int64_t{1} << 62;
  for (const std::int64_t number : {std::int64_t{0}, std::int64_t{-1}, kHuge}) {
    EXPECT_EQ(fate(from().data({0, kUserWriter, number, {}, kSample}).bytes()), Dropped::kNumber)
        << number;
    EXPECT_EQ(fate(from().heartbeat(0, kUserWriter, number, number, 1).bytes()), Dropped::kNumber)
        << number;
    EXPECT_EQ(fate(from().gap(0, kUserWriter, number, 5).bytes()), Dropped::kNumber) << number;
    EXPECT_EQ(fate(from().gap(0, kUserWriter, 1, number).bytes()), Dropped::kNumber) << number;
    EXPECT_EQ(fate(from()
                       .fragments({0, kUserWriter, number, 1, 1, 1024, 4096, PacketBytes(1024)})
                       .bytes()),
              Dropped::kNumber);
  }
  EXPECT_EQ(fate(from().heartbeat(0, kUserWriter, 5, 3, 1).bytes()), Dropped::kNumber)
      << "ends before it begins";
  EXPECT_EQ(fate(from().heartbeat(0, kUserWriter, 1, 1 << 30, 1).bytes()), Dropped::kNumber)
      << "no history is so long";
  EXPECT_EQ(fate(from().acknack(kUserReader, kUserWriter, -1, 0, 1).bytes()), Dropped::kNumber);
}

TEST(Guard, SetsOfMoreThan256NumbersAreDropped) {
  EXPECT_EQ(fate(from().acknack(kUserReader, kUserWriter, 1, 257, 1).bytes()), Dropped::kNumberSet);
  PacketBytes body;
  for (const std::uint32_t word : {kUserReader, kUserWriter}) test::put_entity(body, word);
  test::put_number(body, 1);
  test::put_number(body, 2);
  test::put32(body, 0xffffffffu);
  EXPECT_EQ(fate(from().submessage(kGap, 1, body).bytes()), Dropped::kNumberSet);
  body.resize(body.size() - 4);
  test::put32(body, 256);
  EXPECT_EQ(fate(from().submessage(kGap, 1, body).bytes()), Dropped::kNumberSet)
      << "without its bits";
}

TEST(Guard, CountsAndLengthsOfAnnouncementsStayWithinTheirParameter) {
  constexpr std::uint32_t kAll = 0xffffffffu;
  const std::vector<std::pair<const char*, PacketBytes>> hostile = {
      {"data representations", with(0x0073, {kAll, 0})},
      {"data sharing domains", with(0x8006, {kAll, 0})},
      {"partitions", with(0x0029, {kAll, 1, 0})},
      {"a partition that leads back", with(0x0029, {2, 0xfffffff8u, 0})},
      {"a partition that leads to the end of memory", with(0x0029, {2, 0xffffff00u, 0})},
      {"properties", with(0x0059, {kAll, 1, 0}, kAnnouncer)},
      {"a property's name", with(0x0059, {1, 0xfffffff0u, 0}, kAnnouncer)},
      {"properties of a token", with(0x1001, {1, 0, kAll}, kAnnouncer)},
      {"a token's class", with(0x1002, {0xfffffff0u, 0}, kAnnouncer)},
      {"binary properties of a token", with(0x1001, {1, 0, 0, kAll}, kAnnouncer)},
      {"user data", with(0x002c, {kAll}, kAnnouncer)},
      {"group data", with(0x002d, {64, 0})},
      {"a topic's name", with(0x0005, {0xfffffff0u, 0})},
      {"a name without its end", with(0x0062, {4, 0x41414141u}, kAnnouncer)},
      {"a locator", with(0x0032, {1, 2, 3}, kAnnouncer)},
      {"a GUID", with(0x0050, {1, 2, 3}, kAnnouncer)},
      {"a lease", with(0x0002, {1, 2, 3}, kAnnouncer)},
      {"a lease that is negative", with(0x0002, {0x80000000u, 0}, kAnnouncer)},
  };
  for (const auto& [what, message] : hostile)
    EXPECT_EQ(fate(message), Dropped::kParameters) << what;
  EXPECT_EQ(fate(with(0x0073, {2, 0})), kPasses);
  EXPECT_EQ(fate(with(0x0029, {2, 2, 0x41, 1, 0})), kPasses);

  PacketBytes endless = writer().payload();
  endless.resize(endless.size() - 4);
  EXPECT_EQ(fate(from().data({0, kPublications, 1, {}, endless}).bytes()), Dropped::kParameters)
      << "no sentinel";
  EXPECT_EQ(fate(from().data({0, kUserWriter, 1, {0x70, 0, 0xff, 0x7f}, kSample}).bytes()),
            Dropped::kParameters);
  ParameterList crowded = participant();
  for (int i = 0; i < 100; ++i) crowded.locator(0x0032, 1);
  EXPECT_EQ(fate(announcement(crowded)), Dropped::kParameters) << "a hundred addresses to send to";
}

TEST(Guard, WhatNobodyNeedsOfAnAnnouncementIsBlanked) {
  for (const std::uint16_t id : std::initializer_list<std::uint16_t>{
           0x0069, 0x0072, 0x0075, 0x0035}) {  // type objects, content filters
    Guard guard(kMaxTextSample);
    const PacketBytes message = with(id, {0xfffffff0u, 0});
    const auto passed = guard.check(message, kSocket);
    ASSERT_TRUE(passed) << id;
    EXPECT_EQ(PacketBytes(passed->begin(), passed->end()), with(0x0000, {0xfffffff0u, 0})) << id;
  }
}

/// The message of kSource as the library sees it; empty: not at all.
PacketBytes let_in(Guard& guard, const PacketBytes& message,
                   Guard::Time now = std::chrono::steady_clock::now()) {
  const auto passed = guard.check(message, kSocket, now);
  return passed ? PacketBytes(passed->begin(), passed->end()) : PacketBytes();
}
/// `guard` is that of kOther, to whom kSource has spoken.
void speak(Guard& guard, const Prefix& who = kSource,
           Guard::Time now = std::chrono::steady_clock::now()) {
  guard.sent(Packet(kOther).bytes());
  ASSERT_TRUE(guard.check(Packet(who).to(kOther).acknack(kUserReader, kUserWriter, 0, 0, 1).bytes(),
                          kSocket, now));
}

TEST(Guard, AParticipantThatIsNotHeardIsNotKeptForEver) {
  Guard guard(kMaxTextSample);
  const PacketBytes message = announcement(participant(0x7fffffffu));
  EXPECT_EQ(let_in(guard, message),
            announcement(participant(ParticipantWatch::kStrangersLease.count())));
  speak(guard);
  EXPECT_EQ(let_in(guard, message), announcement(participant(kLongestLeaseSeconds)));
}

TEST(Guard, WhoHasNotSpokenToUsYetIsAStrangerWithAShortLease) {
  Guard guard(kMaxTextSample);
  const PacketBytes message = announcement(participant(100));
  EXPECT_EQ(let_in(guard, message), announcement(participant(10)));
  ASSERT_TRUE(guard.check(from().to(kSource).heartbeat(0, kUserWriter, 1, 1, 1).bytes(), kSocket));
  EXPECT_EQ(let_in(guard, message), announcement(participant(10))) << "it named itself";
  speak(guard);
  EXPECT_EQ(let_in(guard, message), message);
  const ParameterList without = ParameterList().guid(0x0050, kSource, 0x000001c1);
  EXPECT_EQ(fate(announcement(without)), Dropped::kParticipants)
      << "the library would keep it for 100 s";
  EXPECT_EQ(fate(guard, announcement(without)), kPasses) << "one who is known";
}

TEST(Guard, WhereOnlyAStrangerSaysThatItListensAFewDatagramsAreSent) {
  Guard guard(kMaxTextSample);
  const Guard::Time now = Guard::Time() + std::chrono::hours(1);
  ParameterList names = participant();
  for (std::uint16_t port = 1; port <= NamedSockets::kMost; ++port) names.locator(0x0032, port);
  ASSERT_FALSE(let_in(guard, announcement(names), now).empty());
  const auto sent = [&guard](Guard::Time at) {
    int datagrams = 0;
    for (int i = 0; i < 100; ++i) {
      for (std::uint16_t port = 1; port <= NamedSockets::kMost; ++port)
        datagrams += guard.lets_out(loopback(port), at) ? 1 : 0;
    }
    return datagrams;
  };
  EXPECT_EQ(sent(now), ParticipantWatch::kAnswers);
  EXPECT_TRUE(guard.lets_out(loopback(4000), now)) << "nobody's";
  ASSERT_FALSE(let_in(guard, announcement(names), now).empty());
  EXPECT_EQ(sent(now), ParticipantWatch::kAnswers) << "it is still there";
  speak(guard, kSource, now);
  EXPECT_EQ(sent(now), 100 * static_cast<int>(NamedSockets::kMost));
}

TEST(Guard, AStrangerTakesNoAnswersFromWhoIsKnown) {
  Guard guard(kMaxTextSample);
  const Guard::Time now = Guard::Time() + std::chrono::hours(1);
  ASSERT_FALSE(let_in(guard, announcement(participant().locator(0x0032, 5)), now).empty());
  speak(guard, kSource, now);
  const Prefix stranger = {1, 15, 7};
  const ParameterList names =
      ParameterList().guid(0x0050, stranger, 0x000001c1).add(0x0002, lasting(10));
  ASSERT_TRUE(guard.check(
      Packet(stranger)
          .data({0, kAnnouncer, 1, {}, ParameterList(names).locator(0x0032, 5).payload()})
          .bytes(),
      kOtherSocket, now));
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(guard.lets_out(loopback(5), now));
}

TEST(Guard, SocketsBeyondTheSixteenthAreBlanked) {
  ParameterList names = participant(), left = participant();
  for (std::uint16_t port = 1; port <= NamedSockets::kMost + 2; ++port) {
    names.locator(0x0032, port);
    left.locator(port > NamedSockets::kMost ? 0x0000 : 0x0032, port);
  }
  Guard guard(kMaxTextSample);
  EXPECT_EQ(let_in(guard, announcement(names)), announcement(left));
}

/// A socket of another host.
ParameterList& add_elsewhere(ParameterList& list, std::uint16_t id, std::uint16_t port) {
  PacketBytes locator;
  test::put32(locator, 1);
  test::put32(locator, port);
  locator.resize(20);
  test::put_bytes(locator, {192, 0, 2, 1});
  return list.add(id, locator);
}

TEST(Guard, AParticipantListensWhereItSendsFromAndOnNoOtherHost) {
  ParameterList names = participant(), left = participant();
  for (ParameterList* list : {&names, &left}) {
    const bool is_left = list == &left;
    list->locator(0x0032, 5);
    add_elsewhere(*list, is_left ? 0x0000 : 0x0032, 6);
    list->locator(0x0031, 7);
    add_elsewhere(*list, is_left ? 0x0000 : 0x0048, 8);
  }
  Guard guard(kMaxTextSample);
  EXPECT_EQ(let_in(guard, announcement(names)), announcement(left));
  speak(guard);
  EXPECT_EQ(let_in(guard, announcement(names)), announcement(left)) << "also once it is known";
}

TEST(Guard, AnEndpointListensWhereItsParticipantDoesAndNowhereElse) {
  Guard guard(kMaxTextSample);
  ASSERT_FALSE(let_in(guard, announcement(participant().locator(0x0031, 5))).empty());
  speak(guard);
  const auto reader_at = [](std::uint16_t id, std::uint16_t port) {
    return announcement(writer().locator(0x002f, 5).locator(id, port), kSubscriptions);
  };
  EXPECT_EQ(let_in(guard, reader_at(0x002f, 5)), reader_at(0x002f, 5));
  EXPECT_EQ(let_in(guard, reader_at(0x002f, 6)), reader_at(0x0000, 6)) << "another one's port";
  EXPECT_EQ(let_in(guard, reader_at(0x0030, 6)), reader_at(0x0000, 6)) << "a group";
  ParameterList far = writer(), left = writer();
  EXPECT_EQ(let_in(guard, announcement(add_elsewhere(far, 0x002f, 5), kPublications)),
            announcement(add_elsewhere(left, 0x0000, 5), kPublications));
}

/// Says that kSource has gone.
PacketBytes goodbye() {
  const PacketBytes gone =
      ParameterList().guid(0x0070, kSource, 0x000001c1).add(0x0071, {0, 0, 0, 3}).bytes();
  return from().data({0, kAnnouncer, 2, gone, {}}).bytes();
}
/// The goodbye as Cyclone DDS says it: by a key, and in the inline QoS the status alone.
PacketBytes goodbye_by_key(const Prefix& who, std::uint32_t by = kAnnouncer) {
  const std::uint16_t id = by == kAnnouncer ? 0x0050 : 0x005a;
  const PacketBytes status = ParameterList().add(0x0071, {0, 0, 0, 3}).bytes();
  const PacketBytes key = ParameterList().guid(id, who, 0x000001c1).payload();
  PacketBytes message = from().data({0, by, 2, status, key}).bytes();
  message[kHeaderBytes + 1] = kLittleEndian | kInlineQos | kKey;
  return message;
}
/// The ids of the submessages.
std::vector<int> kinds(const PacketBytes& message) {
  std::vector<int> ids;
  Bytes rest = Bytes(message).subspan(kHeaderBytes);
  while (const auto submessage = next_submessage(rest)) ids.push_back(submessage->id);
  return ids;
}

// The library's thread that ends leases may be at the same participant: one of both ends the
// process.
TEST(Guard, AGoodbyeReachesNoReaderOfTheLibraryAndTheLeaseDecides) {
  const PacketBytes with_payload =
      from()
          .data({0, kAnnouncer, 2, ParameterList().add(0x0071, {0, 0, 0, 3}).bytes(),
                 participant().payload()})
          .bytes();
  for (const PacketBytes& message : {goodbye(), goodbye_by_key(kSource), with_payload}) {
    Guard guard(kMaxTextSample);
    const PacketBytes passed = let_in(guard, message);
    ASSERT_EQ(kinds(passed), std::vector<int>{kData});
    EXPECT_EQ(Reader(Bytes(passed).subspan(kHeaderBytes + 8), true).entity(), 0xffffffffu);
  }
  Guard guard(kMaxTextSample);
  EXPECT_EQ(let_in(guard, announcement(participant())).size(), announcement(participant()).size());
  EXPECT_EQ(Reader(Bytes(announcement(participant())).subspan(kHeaderBytes + 8), true).entity(),
            0u);
}

// The library reads who has gone from the inline QoS, and from nowhere else.
TEST(Guard, WhoSaysByAKeyThatItHasGoneSaysItByAHash) {
  for (const std::uint32_t by : {kAnnouncer, kPublications, kSubscriptions}) {
    Guard guard(kMaxTextSample);
    const PacketBytes passed = let_in(guard, goodbye_by_key(kSource, by));
    ASSERT_FALSE(passed.empty());
    const PacketBytes hash =
        ParameterList().add(0x0071, {0, 0, 0, 3}).guid(0x0070, kSource, 0x000001c1).bytes();
    const auto at = std::search(passed.begin(), passed.end(), hash.begin(), hash.end());
    EXPECT_EQ(at - passed.begin(), static_cast<std::ptrdiff_t>(kHeaderBytes + 4 + 20))
        << "behind the head of its sample";
    EXPECT_EQ(passed[kHeaderBytes + 1], kLittleEndian | kInlineQos);
  }
  EXPECT_EQ(fate(goodbye_by_key(kOther)), Dropped::kSource);
  Guard secured(kMaxTextSample, nullptr, {}, Proof::kOfIdentity);
  EXPECT_EQ(kinds(let_in(secured, goodbye_by_key(kSource))), std::vector<int>{kPad});
}

TEST(Guard, WhereParticipantsProveWhoTheyAreNobodyIsSentAwayWithoutProof) {
  Guard open(kMaxTextSample), secured(kMaxTextSample, nullptr, {}, Proof::kOfIdentity);
  EXPECT_EQ(kinds(let_in(open, goodbye())), std::vector<int>{kData});
  EXPECT_EQ(kinds(let_in(secured, goodbye())), std::vector<int>{kPad});
  const PacketBytes of_writer =
      ParameterList().guid(0x0070, kSource, kUserWriter).add(0x0071, {0, 0, 0, 3}).bytes();
  const PacketBytes writer_gone = from().data({0, kPublications, 9, of_writer, {}}).bytes();
  EXPECT_EQ(let_in(open, writer_gone), writer_gone);
  EXPECT_EQ(kinds(let_in(secured, writer_gone)), std::vector<int>{kGap})
      << "else its number is asked for for ever";
  const PacketBytes alive_and_gone =
      from()
          .data({0, kAnnouncer, 2, ParameterList().add(0x0071, {0, 0, 0, 3}).bytes(),
                 participant().payload()})
          .bytes();
  EXPECT_EQ(kinds(let_in(secured, alive_and_gone)), std::vector<int>{kPad});
  const PacketBytes signed_one =
      from()
          .submessage(kSecureRtpsPrefix, 1, PacketBytes(20))
          .data(
              {0,
               kAnnouncer,
               2,
               ParameterList().guid(0x0070, kSource, 0x000001c1).add(0x0071, {0, 0, 0, 3}).bytes(),
               {}})
          .submessage(kSecureRtpsPostfix, 1, PacketBytes(20))
          .bytes();
  Guard all_signed(kMaxTextSample, nullptr, {}, Proof::kOfMessages);
  EXPECT_EQ(let_in(all_signed, signed_one), signed_one) << "the library holds it against the key";
  EXPECT_NE(let_in(secured, signed_one), signed_one) << "it has no keys for messages there";
}

TEST(Guard, WhereParticipantsProveWhoTheyAreNobodySaysSomethingElseOfThem) {
  Guard open(kMaxTextSample), secured(kMaxTextSample, nullptr, {}, Proof::kOfIdentity);
  for (Guard* guard : {&open, &secured}) {
    ASSERT_FALSE(let_in(*guard, announcement(participant(10).locator(0x0032, 5))).empty());
    speak(*guard);
    EXPECT_EQ(kinds(let_in(*guard, announcement(participant(10).locator(0x0032, 5)))),
              std::vector<int>{kData});
  }
  for (const ParameterList& other :
       {participant(1).locator(0x0032, 5), participant(10).locator(0x0032, 6)}) {
    EXPECT_EQ(kinds(let_in(secured, announcement(other))), std::vector<int>{kPad});
    EXPECT_EQ(kinds(let_in(open, announcement(other))), std::vector<int>{kData});
  }
}

/// `inner`, a message, as if it were signed.
PacketBytes signed_message(const PacketBytes& inner, const PacketBytes& behind_prefix = {}) {
  PacketBytes message = from().submessage(kSecureRtpsPrefix, 1, PacketBytes(20)).bytes();
  test::put_bytes(message, behind_prefix);
  test::put_bytes(message, PacketBytes(inner.begin() + kHeaderBytes, inner.end()));
  test::put_bytes(message, {kSecureRtpsPostfix, 1, 20, 0});
  test::put_bytes(message, PacketBytes(20));
  return message;
}

TEST(Guard, WhereMessagesAreSignedNothingThatIsNotSpeaksForAnEndpointOfATopic) {
  for (const PacketBytes& message :
       {from().heartbeat(0, kUserWriter, 1000, 1000, 1).bytes(),
        from().gap(0, kUserWriter, 1, 1000).bytes(),
        from().acknack(kUserReader, kUserWriter, 1000, 0, 1).bytes(),
        from().data({0, kUserWriter, 1000, {}, kSample}).bytes(),
        from().fragments({0, kUserWriter, 9, 1, 1, 1024, 4096, PacketBytes(1024)}).bytes()}) {
    Guard open(kMaxTextSample), identified(kMaxTextSample, nullptr, {}, Proof::kOfIdentity),
        all_signed(kMaxTextSample, nullptr, {}, Proof::kOfMessages);
    EXPECT_EQ(let_in(open, message), message);
    EXPECT_EQ(let_in(identified, message), message) << "its plant signs none";
    EXPECT_EQ(kinds(let_in(all_signed, message)), std::vector<int>{kPad});
    EXPECT_EQ(all_signed.counts().of(Dropped::kSecurity), 1u);
    EXPECT_EQ(let_in(all_signed, signed_message(message)), signed_message(message));
  }
  const PacketBytes wrapped = from()
                                  .submessage(kSecurePrefix, 1, PacketBytes(20))
                                  .heartbeat(0, kUserWriter, 1000, 1000, 1)
                                  .submessage(kSecurePostfix, 1, PacketBytes(20))
                                  .bytes();
  Guard beside(kMaxTextSample, nullptr, {}, Proof::kOfMessages);
  EXPECT_NE(let_in(beside, wrapped), wrapped) << "endpoints of topics have no keys of their own";
  Guard all_signed(kMaxTextSample, nullptr, {}, Proof::kOfMessages);
  EXPECT_EQ(kinds(let_in(all_signed, announcement(participant()))), std::vector<int>{kData})
      << "nobody can sign it yet";
}

TEST(Guard, WhereParticipantsProveWhoTheyAreEndpointsOfSecuritySayNothingInTheClear) {
  constexpr std::uint32_t kSecurePublications = 0xff0003c2;
  const PacketBytes plain = from().heartbeat(0, kSecurePublications, 1000, 1000, 1).bytes();
  Guard open(kMaxTextSample), secured(kMaxTextSample, nullptr, {}, Proof::kOfIdentity);
  EXPECT_EQ(let_in(open, plain), plain);
  EXPECT_EQ(kinds(let_in(secured, plain)), std::vector<int>{kPad});
  const PacketBytes liveliness = from().acknack(0xff0200c7, 0xff0200c2, 1, 0, 1).bytes();
  EXPECT_EQ(let_in(secured, liveliness), liveliness) << "which the rules of plants do not protect";
  const PacketBytes wrapped = from()
                                  .submessage(kSecurePrefix, 1, PacketBytes(20))
                                  .heartbeat(0, kSecurePublications, 1000, 1000, 1)
                                  .submessage(kSecurePostfix, 1, PacketBytes(20))
                                  .bytes();
  EXPECT_EQ(let_in(secured, wrapped), wrapped) << "the library holds it against the key";
}

TEST(Guard, WhatIsSignedIsNotChanged) {
  Guard guard(kMaxTextSample, nullptr, {}, Proof::kOfMessages);
  const auto skips = [&](std::int64_t first, std::uint32_t count) {
    return signed_message(from().heartbeat(0, kUserWriter, first, first, count).bytes());
  };
  EXPECT_EQ(let_in(guard, skips(4'000'000, 1)), skips(4'000'000, 1));
  EXPECT_EQ(fate(guard, skips(std::int64_t{1} << 40, 2)), Dropped::kSkipped);
  EXPECT_EQ(
      fate(guard, signed_message(from().gap(0, kUserWriter, 1, std::int64_t{1} << 40).bytes())),
      Dropped::kSkipped);
}

TEST(Guard, ASignedMessageMayRepeatItsHeaderAndNameNobodyElse) {
  Guard guard(kMaxTextSample, nullptr, {}, Proof::kOfMessages);
  const auto names = [](const Prefix& who) {
    PacketBytes info = {kInfoSource, 1, 20, 0, 0, 0, 0, 0, 2, 3, 1, 15};
    test::put_bytes(info, PacketBytes(who.begin(), who.end()));
    return info;
  };
  const PacketBytes inner = from().heartbeat(0, kUserWriter, 1, 1, 1).bytes();
  EXPECT_EQ(fate(guard, signed_message(inner, names(kSource))), kPasses);
  EXPECT_EQ(fate(guard, signed_message(inner, names(kOther))), Dropped::kSource);
}

/// The beginning of a handshake by `speaker`, little endian.
PacketBytes identities(const Prefix& speaker) {
  PacketBytes begin(4 + 96);
  begin[1] = 1;
  std::copy(speaker.begin(), speaker.end(), begin.begin() + 4);
  return begin;
}

TEST(Guard, TheHandshakeOfStrangersIsReadBeforeTheLibraryReadsIt) {
  constexpr std::uint32_t kHandshake = 0x000201c3;
  const auto handshake = [](const std::vector<std::uint32_t>& words) {
    PacketBytes payload = identities(kSource);
    for (const std::uint32_t word : words) test::put32(payload, word);
    return from().data({0x000201c4, kHandshake, 1, {}, payload}).bytes();
  };
  EXPECT_EQ(fate(handshake({1, 0, 1, 1, 0, 0, 0})), kPasses);
  EXPECT_EQ(fate(handshake({1, 0, 0xffffffffu})), Dropped::kParameters) << "tokens";
  EXPECT_EQ(fate(handshake({1, 0, 1, 1, 0, 0, 1, 1, 0, 0xffffffffu})), Dropped::kParameters)
      << "binary value";
  EXPECT_EQ(fate(handshake({0xfffffff0u})), Dropped::kParameters) << "class";
}

/// A handshake by kSource that says it is of `speaker`, and proves that the certificate is of
/// `proven`.
PacketBytes handshake_of(const Prefix& speaker, const PacketBytes& proven,
                         std::uint32_t by = 0x000201c3) {
  PacketBytes payload = identities(speaker);
  for (const std::uint32_t word : {1, 0, 1, 1, 0, 0, 2})
    test::put32(payload, word);  // class, token, two octet values
  test::put_bytes(payload, {5, 0, 0, 0, 'c', '.', 'i', 'd', 0, 0, 0, 0, 0, 0, 0, 0});
  test::put_bytes(payload, {8, 0, 0, 0, 'c', '.', 'p', 'd', 'a', 't', 'a', 0});
  test::put32(payload, static_cast<std::uint32_t>(proven.size()));
  test::put_bytes(payload, proven);
  return from().data({0x000201c4, by, 1, {}, payload}).bytes();
}

/// The library wants it big endian.
PacketBytes announced_guid(std::uint16_t id, const Prefix& of) {
  PacketBytes list(32);
  const PacketBytes begin = {0, 0x15, 0, 4, 2, 3, 0, 0, 0, static_cast<unsigned char>(id), 0, 16};
  std::copy(begin.begin(), begin.end(), list.begin());
  std::copy(of.begin(), of.end(), list.begin() + 12);
  list[29] = 1;  // the end
  return list;
}

TEST(Guard, WhoShowsACertificateSpeaksForItselfAlone) {
  EXPECT_EQ(fate(handshake_of(kSource, announced_guid(0x50, kSource))), kPasses);
  EXPECT_EQ(fate(handshake_of(kOther, announced_guid(0x50, kSource))), Dropped::kSource)
      << "in another's handshake";
  EXPECT_EQ(fate(handshake_of(kSource, announced_guid(0x50, kOther))), Dropped::kSource)
      << "own proof, other's GUID";
  EXPECT_EQ(fate(handshake_of(kSource, announced_guid(0x70, kOther))), Dropped::kSource)
      << "by its key hash";
  EXPECT_EQ(fate(handshake_of(kSource, announced_guid(0x05, kSource))), Dropped::kSource)
      << "without a GUID";
  EXPECT_EQ(fate(handshake_of(kSource, announced_guid(0x50, kOther), kUserWriter)),
            Dropped::kSource)
      << "by whichever writer";
}

TEST(Guard, FragmentsThatTheirSampleDoesNotHaveAreDropped) {
  const auto fragments = [](std::uint32_t first, std::uint16_t count, std::uint16_t size,
                            std::uint32_t sample, std::size_t payload,
                            std::uint32_t by = kUserWriter) {
    return from().fragments({0, by, 1, first, count, size, sample, PacketBytes(payload)}).bytes();
  };
  EXPECT_EQ(fate(fragments(4, 1, 1000, 3500, 500)), kPasses) << "the last one is shorter";
  EXPECT_EQ(fate(fragments(0, 1, 1024, 4096, 1024)), Dropped::kFragment)
      << "the first has number 1";
  EXPECT_EQ(fate(fragments(5, 1, 1024, 4096, 1024)), Dropped::kFragment) << "four fragments";
  EXPECT_EQ(fate(fragments(3, 3, 1024, 4096, 3072)), Dropped::kFragment);
  EXPECT_EQ(fate(fragments(0xffffffffu, 2, 1024, 4096, 2048)), Dropped::kFragment)
      << "wraps around";
  EXPECT_EQ(fate(fragments(1, 0, 1024, 4096, 1024)), Dropped::kFragment);
  EXPECT_EQ(fate(fragments(1, 1, 0, 4096, 1024)), Dropped::kFragment) << "fragments without size";
  EXPECT_EQ(fate(fragments(1, 1, 1, 4096, 4)), Dropped::kFragment)
      << "the library keeps a list in each";
  EXPECT_EQ(fate(fragments(1, 2, 1024, 4096, 1024)), Dropped::kFragment) << "two said, one there";
  EXPECT_EQ(fate(fragments(1, 1, 1024, 4096, 1024, kPublications)), Dropped::kFragment)
      << "would hide a list";
  EXPECT_EQ(fate(fragments(2, 1, 60000, kMaxTextSample + 1, 60000)), Dropped::kSampleSize);

  Guard guard(kMaxTextSample);
  EXPECT_EQ(fate(guard, fragments(1, 1, 1024, 4096, 1024)), kPasses);
  EXPECT_EQ(fate(guard, fragments(2, 1, 2048, 4096, 2048)), Dropped::kFragment)
      << "another size than before";
}

TEST(Guard, OfASampleThatIsTooLargeTheBeginningPassesAsASampleThatSaysSo) {
  Guard guard(kMaxTextSample);
  PacketBytes beginning(60000, 'x');
  std::copy(kSample.begin(), kSample.end(), beginning.begin());
  const PacketBytes first =
      from().fragments({0, kUserWriter, 7, 1, 1, 60000, 40u << 20, beginning}).bytes();
  const auto passed = guard.check(first, kSocket);
  ASSERT_TRUE(passed);
  Bytes rest = passed->subspan(kHeaderBytes);
  const auto data = next_submessage(rest);
  ASSERT_TRUE(data);
  EXPECT_EQ(data->id, kData);
  EXPECT_EQ(data->flags, kLittleEndian | kPayload);
  const Bytes sample = data->body.last(beginning.size());
  EXPECT_EQ(whole_size(sample), 40u << 20);
  EXPECT_TRUE(std::equal(kSample.begin() + 4, kSample.end(), sample.begin() + 4));
  const PacketBytes again(passed->begin(), passed->end());
  EXPECT_EQ(fate(guard, again), kPasses) << "a guard behind this one finds nothing wrong";
}

TEST(Guard, TheSizeOfACutSampleIsNeverBelowWhatItHas) {
  PacketBytes sample(5000);
  EXPECT_EQ(whole_size(sample), sample.size());
  for (const std::uint32_t bytes : {(32u << 20) + 1, 40u << 20, 0xffffffffu}) {
    const auto options = options_of_cut(bytes);
    std::copy(options.begin(), options.end(), sample.begin() + kOptionsAt);
    EXPECT_GE(whole_size(sample), bytes);
    EXPECT_LT(whole_size(sample) - bytes, kMebibyte);
  }
  sample[kOptionsAt] = kIsCut;
  sample[kOptionsAt + 1] = 0;
  EXPECT_EQ(whole_size(sample), sample.size());
  EXPECT_EQ(whole_size(Bytes(sample).first(3)), 3u);
}

TEST(Guard, SamplesBegunAndNotFinishedAreBounded) {
  Guard guard(kMaxTextSample);
  int begun = 0;
  for (std::int64_t number = 1; number <= 64; ++number) {
    const PacketBytes first =
        from()
            .fragments({0, kUserWriter, number, 1, 1, 60000, kMaxTextSample, PacketBytes(60000)})
            .bytes();
    if (fate(guard, first) == kPasses) ++begun;
  }
  EXPECT_EQ(begun, static_cast<int>(UnfinishedSamples::kMostBytesOfOne / kMaxTextSample));
  const PacketBytes of_another =
      Packet(kOther)
          .fragments({0, kUserWriter, 1, 1, 1, 60000, kMaxTextSample, PacketBytes(60000)})
          .bytes();
  EXPECT_EQ(fate(guard, of_another), kPasses);
  EXPECT_EQ(fate(guard, from().data({0, kUserWriter, 70, {}, kSample}).bytes()), kPasses)
      << "small ones go on";
}

TEST(Guard, FinishedSamplesMakeRoom) {
  Guard guard(kMaxTextSample);
  constexpr std::uint32_t kFragments = (kMaxTextSample + 59999) / 60000;
  for (std::int64_t number = 1; number <= 20; ++number) {
    for (std::uint32_t first = 1; first <= kFragments; ++first) {
      const std::size_t size = std::min<std::size_t>(60000, kMaxTextSample - (first - 1) * 60000);
      const PacketBytes part = from()
                                   .fragments({0, kUserWriter, number, first, 1, 60000,
                                               kMaxTextSample, PacketBytes(size)})
                                   .bytes();
      ASSERT_EQ(fate(guard, part), kPasses) << "sample " << number << " fragment " << first;
    }
  }
}

std::int64_t first_of(Bytes message) {
  Bytes rest = message.subspan(kHeaderBytes);
  while (const auto submessage = next_submessage(rest)) {
    if (submessage->id != kHeartbeat) continue;
    Reader reader(submessage->body.subspan(8), submessage->little_endian());
    return reader.sequence_number().value_or(0);
  }
  return 0;
}

TEST(Guard, AWriterThatSkipsABillionNumbersIsFollowedInSteps) {
  Guard guard(kMaxTextSample);
  constexpr std::int64_t kFirst = 1'000'000'001;
  Guard::Time now = std::chrono::steady_clock::now();
  std::int64_t reached = 0;
  int steps = 0;
  for (std::uint32_t count = 1; reached < kFirst && steps < 100'000; ++count, ++steps) {
    now += std::chrono::milliseconds(100);
    const PacketBytes heartbeat =
        from().heartbeat(0, kUserWriter, kFirst, kFirst + 3, count).bytes();
    const auto passed = guard.check(heartbeat, kSocket, now);
    ASSERT_TRUE(passed);
    const std::int64_t first = first_of(*passed);
    ASSERT_LE(first - reached, SequenceWatch::kHeartbeatStep + 1)
        << "the library counts through each";
    reached = first;
    guard.sent(
        Packet(kOther).to(kSource).acknack(kUserReader, kUserWriter, first, 0, count).bytes());
  }
  EXPECT_EQ(reached, kFirst) << "it arrives in the end";
}

TEST(Guard, WhatOurReaderHasNotConfirmedIsNotSkippedFurther) {
  Guard guard(kMaxTextSample);
  for (std::uint32_t count = 1; count <= 100; ++count) {
    const PacketBytes heartbeat =
        from()
            .heartbeat(0, kUserWriter, std::int64_t{1} << 40, std::int64_t{1} << 40, count)
            .bytes();
    const auto passed = guard.check(heartbeat, kSocket);
    ASSERT_TRUE(passed);
    EXPECT_LE(first_of(*passed), SequenceWatch::kHeartbeatStep + 1);
  }
}

TEST(Guard, AGapIsTakenInSteps) {
  Guard guard(kMaxTextSample);
  constexpr std::int64_t kEnd = 100'000'000;
  Guard::Time now = std::chrono::steady_clock::now();
  std::int64_t reached = 1;
  for (int step = 0; step < 10'000 && reached < kEnd; ++step) {
    now += std::chrono::milliseconds(100);
    const PacketBytes gap = from().gap(0, kUserWriter, 1, kEnd).bytes();
    const auto passed = guard.check(gap, kSocket, now);
    if (!passed) continue;
    Reader reader(passed->subspan(kHeaderBytes + 4 + 8), true);
    const std::int64_t start = reader.sequence_number().value_or(0),
                       end = reader.sequence_number().value_or(0);
    ASSERT_EQ(start, reached) << "nothing is left out";
    ASSERT_LE(end - start, SequenceWatch::kGapStep);
    reached = end;
  }
  EXPECT_EQ(reached, kEnd);
}

TEST(Guard, AFloodOfGapsDoesNotKeepTheReceiverBusy) {
  Guard guard(kMaxTextSample);
  const Guard::Time now = std::chrono::steady_clock::now();
  for (std::int64_t i = 0; i < 1000; ++i) {
    static_cast<void>(guard.check(from().gap(0, kUserWriter, 1 + (i << 20), (i + 1) << 20).bytes(),
                                  kSocket, now));
  }
  EXPECT_GT(guard.counts().of(Dropped::kSkipped), 900u);
  EXPECT_EQ(fate(guard, from().gap(0, kUserWriter, 1, 100).bytes()), kPasses) << "small ones go on";
}

TEST(Guard, ACountThatJumpsIsDroppedAndTheHonestOneGoesOn) {
  Guard guard(kMaxTextSample);
  constexpr std::uint32_t kAll = 0xffffffffu;
  EXPECT_EQ(fate(guard, from().heartbeat(0, kUserWriter, 1, 1, 10).bytes()), kPasses);
  EXPECT_EQ(fate(guard, from().heartbeat(0, kUserWriter, 1, 1, kAll).bytes()), Dropped::kCount);
  EXPECT_EQ(fate(guard, from().heartbeat(0, kUserWriter, 1, 1, 11).bytes()), kPasses);
  EXPECT_EQ(fate(guard, from().acknack(kUserReader, kUserWriter, 1, 0, 3).bytes()), kPasses);
  EXPECT_EQ(fate(guard, from().acknack(kUserReader, kUserWriter, 1, 0, kAll).bytes()),
            Dropped::kCount);
  EXPECT_EQ(fate(guard, from().acknack(kUserReader, kUserWriter, 1, 0, 4).bytes()), kPasses);
}

TEST(Guard, FragmentsThatWereNeverSentAreNotAskedFor) {
  Guard guard(kMaxTextSample);
  const auto asks = [](std::int64_t number, std::uint32_t fragment, std::uint32_t count) {
    return from().nack_frag(kUserReader, kUserWriter, number, fragment, count).bytes();
  };
  EXPECT_EQ(fate(guard, asks(7, 1, 1)), Dropped::kNotSent);
  guard.sent(
      Packet(kOther).fragments({0, kUserWriter, 7, 1, 1, 1024, 4096, PacketBytes(1024)}).bytes());
  EXPECT_EQ(fate(guard, asks(7, 4, 2)), kPasses);
  EXPECT_EQ(fate(guard, asks(7, 5, 3)), Dropped::kNotSent);
  EXPECT_EQ(fate(guard, asks(7, 0xffffffffu, 4)), Dropped::kNotSent);
  EXPECT_EQ(fate(guard, asks(7, 0, 5)), Dropped::kNumber);
}

/// A participant that the guard of kOther knows, which has a socket of its own.
Prefix known_inhabitant(Guard& guard, std::uint16_t number, Guard::Time now) {
  Prefix prefix = kSource;
  prefix[10] = static_cast<unsigned char>(number);
  const ParameterList list =
      ParameterList().guid(0x0050, prefix, 0x000001c1).add(0x0002, lasting(100));
  const PacketBytes announced = Packet(prefix).data({0, kAnnouncer, 1, {}, list.payload()}).bytes();
  EXPECT_TRUE(guard.check(announced, loopback(5000 + number), now));
  speak(guard, prefix, now);
  return prefix;
}

TEST(Guard, WhatWasSentIsNotAskedForAgainWithoutEnd) {
  Guard guard(kMaxTextSample);
  constexpr std::uint32_t kBytes = 30u << 20, kSize = 60000;
  guard.sent(Packet(kOther)
                 .fragments({0, kUserWriter, 7, 1, 1, kSize, kBytes, PacketBytes(kSize)})
                 .bytes());
  Guard::Time now = std::chrono::steady_clock::now();
  std::uint32_t count = 0;
  const auto passes = [&](const Packet& message) {
    return guard.check(message.bytes(), kSocket, now).has_value();
  };
  const auto asks = [&](const Prefix& who, std::uint32_t samples = 1) {
    return Packet(who).to(kOther).acknack(kUserReader, kUserWriter, 7, samples, ++count);
  };
  const Prefix one = known_inhabitant(guard, 1, now), other = known_inhabitant(guard, 2, now);
  int answered = 0;
  for (int i = 0; i < 100; ++i) answered += passes(asks(one)) ? 1 : 0;
  EXPECT_EQ(answered, 5) << "128 MB at once";
  EXPECT_FALSE(passes(Packet(one).nack_frag(kUserReader, kUserWriter, 7, 1, ++count)));
  EXPECT_GT(guard.counts().of(Dropped::kRepairs), 90u);
  EXPECT_TRUE(passes(asks(one, 0))) << "it confirms";
  EXPECT_TRUE(passes(asks(other))) << "who has asked for little";
  now += std::chrono::seconds(10);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(passes(asks(one)));
  int all = 0;
  for (std::uint16_t number = 3; number < 23; ++number) {
    const Prefix who = known_inhabitant(guard, number, now);
    EXPECT_TRUE(passes(asks(who))) << "each a little";
    for (int i = 0; i < 10; ++i) all += passes(asks(who)) ? 1 : 0;
  }
  EXPECT_LT(all, 60) << "512 MB and half of what each may have";
}

/// The number of samples of an ACKNACK for kOther that are left to be sent again; 0: dropped.
int asked_for(Guard& guard, const PacketBytes& acknack, Guard::Time now) {
  const auto passed = guard.check(acknack, kSocket, now);
  if (!passed) return 0;
  Reader reader(passed->subspan(kHeaderBytes + 16 + 4 + 16), true);
  const std::uint32_t bits = reader.u32().value_or(0);
  int count = 0;
  for (std::uint32_t at = 0; at < bits; at += 32) {
    const std::uint32_t word = reader.u32().value_or(0), used = bits - at;
    count += std::popcount(used >= 32 ? word : word & ~(UINT32_MAX >> used));
  }
  return count;
}

TEST(Guard, WhoMissesManySmallSamplesAfterALargeOneIsSentThemAgain) {
  Guard guard(kMaxTextSample);
  constexpr std::uint32_t kLarge = 30u << 20, kSize = 60000;
  constexpr std::uint32_t kSmallOnes = 60;
  guard.sent(Packet(kOther)
                 .fragments({0, kUserWriter, 7, 1, 1, kSize, kLarge, PacketBytes(kSize)})
                 .bytes());
  for (std::int64_t number = 8; number < 8 + kSmallOnes; ++number)
    guard.sent(Packet(kOther).data({0, kUserWriter, number, {}, kSample}).bytes());
  const Guard::Time now = std::chrono::steady_clock::now();
  const Prefix one = known_inhabitant(guard, 1, now);
  for (std::uint32_t count = 1; count <= 1000; ++count) {
    const Packet asks =
        Packet(one).to(kOther).acknack(kUserReader, kUserWriter, 8, kSmallOnes, count);
    ASSERT_EQ(asked_for(guard, asks.bytes(), now), static_cast<int>(kSmallOnes)) << count;
  }
  EXPECT_EQ(guard.counts().of(Dropped::kRepairs), 0u);
  const Packet asks_for_large =
      Packet(one).to(kOther).acknack(kUserReader, kUserWriter, 7, 1, 1001);
  EXPECT_EQ(asked_for(guard, asks_for_large.bytes(), now), 1);
}

TEST(Guard, WhoAsksForAllThatThereIsMakesTheServerSendNoMoreThanTheLimit) {
  Guard guard(kMaxTextSample);
  constexpr std::uint32_t kLarge = 30u << 20, kSize = 60000;
  for (std::int64_t number = 1; number <= 64; ++number)
    guard.sent(Packet(kOther)
                   .fragments({0, kUserWriter, number, 1, 1, kSize, kLarge, PacketBytes(kSize)})
                   .bytes());
  const Guard::Time begin = std::chrono::steady_clock::now();
  static_cast<void>(known_inhabitant(guard, 1, begin));
  const Prefix hostile =
      known_inhabitant(guard, 1, begin);  // no stranger any more: its lease is what it says
  std::uint32_t count = 0;
  double sent = 0;
  for (std::chrono::milliseconds after{0}; after < std::chrono::seconds(60);
       after += std::chrono::milliseconds(50)) {
    const Guard::Time now = begin + after;
    const Packet all =
        Packet(hostile).to(kOther).acknack(kUserReader, kUserWriter, 1, 256, ++count);
    sent += static_cast<double>(kLarge) * std::min(64, asked_for(guard, all.bytes(), now));
    const Packet parts =
        Packet(hostile).to(kOther).nack_frag(kUserReader, kUserWriter, 64, 1, count);
    if (guard.check(parts.bytes(), kSocket, now)) sent += kSize;
    const double limit = RepairWatch::kAtOnce +
                         RepairWatch::kPerSecond * std::chrono::duration<double>(after).count() +
                         RepairWatch::kPerSecond * RepairWatch::kDebtSeconds;
    ASSERT_LE(sent, limit) << "after " << after.count() << " ms";
  }
  EXPECT_GT(sent, 50 * RepairWatch::kPerSecond) << "and what is allowed it gets";
}

TEST(Guard, NobodyIsRefusedForLongerThanTwoSeconds) {
  Guard guard(kMaxTextSample);
  constexpr std::uint32_t kLarge = 32u << 20, kSize = 60000;
  for (std::int64_t number = 1; number <= 64; ++number)
    guard.sent(Packet(kOther)
                   .fragments({0, kUserWriter, number, 1, 1, kSize, kLarge, PacketBytes(kSize)})
                   .bytes());
  const Guard::Time now = std::chrono::steady_clock::now();
  const Prefix one = known_inhabitant(guard, 1, now);
  const auto asks = [&](std::uint32_t samples, std::uint32_t count, Guard::Time when) {
    const Packet message =
        Packet(one).to(kOther).acknack(kUserReader, kUserWriter, 1, samples, count);
    return asked_for(guard, message.bytes(), when);
  };
  EXPECT_EQ(asks(64, 1, now), 7) << "the first of them: 256 MB";
  EXPECT_EQ(asks(64, 2, now), 0);
  EXPECT_GE(asks(1, 3, now + std::chrono::milliseconds(2010)), 1);
}

TEST(Guard, OneSocketDoesNotInventParticipantsWithoutEnd) {
  Guard guard(kMaxTextSample);
  int passed = 0;
  for (unsigned char i = 0; i < 200; ++i) {
    Prefix prefix = kSource;
    prefix[11] = i;
    const ParameterList list =
        ParameterList().guid(0x0050, prefix, 0x000001c1).add(0x0002, lasting(10));
    if (guard.check(Packet(prefix).data({0, kAnnouncer, 1, {}, list.payload()}).bytes(), kSocket))
      ++passed;
  }
  EXPECT_EQ(passed, ParticipantWatch::kNewOfOneSocket);
  EXPECT_TRUE(guard.check(announcement(participant()), kOtherSocket)) << "from another socket";
}

/// A participant of a socket of its own.
Prefix inhabitant(std::uint64_t number) {
  Prefix prefix = kSource;
  for (std::size_t i = 0; i < 4; ++i)
    prefix[8 + i] = static_cast<unsigned char>(number >> 8 * (3 - i));
  return prefix;
}
bool hears(Guard& guard, std::uint64_t number, Guard::Time now, std::uint32_t lease_s = 20) {
  const Prefix prefix = inhabitant(number);
  const ParameterList list =
      ParameterList().guid(0x0050, prefix, 0x000001c1).add(0x0002, lasting(lease_s));
  return guard
      .check(Packet(prefix).data({0, kAnnouncer, 1, {}, list.payload()}).bytes(), 1000 + number,
             now)
      .has_value();
}

TEST(Guard, FiveHundredThatStartAtOnceAreAllHeardWithinTheirFirstAnnouncements) {
  Guard guard(kMaxTextSample);
  std::vector<std::uint64_t> unheard(500);
  std::iota(unheard.begin(), unheard.end(), 0);
  Guard::Time now = Guard::Time() + std::chrono::hours(1);
  for (int round = 0; round < 5; ++round, now += std::chrono::milliseconds(200)) {
    std::vector<std::uint64_t> heard;
    std::erase_if(unheard, [&](std::uint64_t one) {
      const bool is_heard = hears(guard, one, now);
      if (is_heard) heard.push_back(one);
      return is_heard;
    });
    for (const std::uint64_t one : heard) speak(guard, inhabitant(one), now);
  }
  EXPECT_TRUE(unheard.empty()) << unheard.size();
}

TEST(Guard, InACrowdWhoAnnouncesItselfAgainIsHeard) {
  Guard guard(kMaxTextSample);
  const Guard::Time now = Guard::Time() + std::chrono::hours(1);
  for (std::uint64_t i = 0; i < ParticipantWatch::kCrowd; ++i) ASSERT_TRUE(hears(guard, i, now));
  EXPECT_FALSE(hears(guard, 5000, now));
  EXPECT_TRUE(hears(guard, 5000, now + std::chrono::milliseconds(100)));
  EXPECT_TRUE(hears(guard, 0, now)) << "known";
}

TEST(Guard, InventedParticipantsAreNoMoreThanTheLibraryCanBearAndTheirPlacesAreFreeAgain) {
  Guard guard(kMaxTextSample);
  const Guard::Time begun = Guard::Time() + std::chrono::hours(1);
  ASSERT_TRUE(hears(guard, 0, begun, 300));
  speak(guard, inhabitant(0), begun);
  std::size_t heard = 0;
  for (std::uint64_t i = 1; i < 60000; ++i) {  // 2000 a second, each twice
    const Guard::Time now = begun + std::chrono::microseconds(500 * i);
    const bool first = hears(guard, i, now, 300), second = hears(guard, i, now, 300);
    heard += first || second ? 1 : 0;
    if (i % 1000 == 0) {
      EXPECT_TRUE(hears(guard, 0, now, 300)) << "whoever is known stays so: " << i;
    }
  }
  EXPECT_LE(heard,
            ParticipantWatch::kStrangersAtOnce + 30 * ParticipantWatch::kStrangersPerSecond + 1);
  const Guard::Time over = begun + std::chrono::seconds(30) + ParticipantWatch::kStrangersLease;
  EXPECT_TRUE(hears(guard, 70000, over));
}

TEST(Guard, AThousandThatAreInventedOnceAreForgottenTogetherAndThatIsCheap) {
  Guard guard(kMaxTextSample);
  const Guard::Time now = Guard::Time() + std::chrono::hours(1);
  std::size_t heard = 0;
  for (std::uint64_t i = 0; i < 1000; ++i) heard += hears(guard, i, now, 40) ? 1 : 0;
  EXPECT_EQ(heard, ParticipantWatch::kCrowd);
  EXPECT_FALSE(hears(guard, 5000, now));
  EXPECT_TRUE(hears(guard, 5000, now + std::chrono::milliseconds(100)))
      << "who is there announces itself again";
}

TEST(Guard, WhoLeavesMakesRoom) {
  Guard guard(kMaxTextSample);
  const Guard::Time now = Guard::Time() + std::chrono::hours(1);
  for (std::uint64_t i = 0; i < ParticipantWatch::kCrowd; ++i) ASSERT_TRUE(hears(guard, i, now));
  const Prefix leaver = inhabitant(7);
  const PacketBytes leaves =
      ParameterList().guid(0x0070, leaver, 0x000001c1).add(0x0071, {0, 0, 0, 3}).bytes();
  ASSERT_TRUE(guard.check(Packet(leaver).data({0, kAnnouncer, 2, leaves, {}}).bytes(), 1007, now));
  EXPECT_TRUE(hears(guard, 5000, now));
}

TEST(Guard, TheEndpointsOfAParticipantAreCountedAndOneTooManyIsSkipped) {
  constexpr std::size_t kMost = 5;
  Guard guard(kMaxTextSample, nullptr, {}, Proof::kNone, kMost);
  const auto announced = [](std::uint32_t entity, const Prefix& of = kSource) {
    const ParameterList list =
        ParameterList().guid(0x005a, of, entity).text(0x0005, "Topic").text(0x0007, "Type");
    return Packet(of).data({0, kPublications, 7, {}, list.payload()}).bytes();
  };
  const auto kind = [&](const PacketBytes& message) { return kinds(let_in(guard, message)); };
  EXPECT_EQ(kind(announced(0x103)), std::vector<int>{kData}) << "of nobody whom the library knows";
  ASSERT_FALSE(let_in(guard, announcement(participant(100))).empty());
  speak(guard);
  for (std::uint32_t i = 1; i <= kMost; ++i)
    EXPECT_EQ(kind(announced(i << 8 | 3)), std::vector<int>{kData}) << i;
  EXPECT_EQ(kind(announced(6u << 8 | 3)), std::vector<int>{kGap})
      << "else its number is asked for for ever";
  EXPECT_EQ(guard.counts().of(Dropped::kEndpoints), 1u);
  EXPECT_EQ(kind(announced(2u << 8 | 3)), std::vector<int>{kData}) << "one that is known";
  const PacketBytes hash =
      ParameterList().guid(0x0070, kSource, 2u << 8 | 3).add(0x0071, {0, 0, 0, 3}).bytes();
  ASSERT_FALSE(let_in(guard, from().data({0, kPublications, 8, hash, {}}).bytes()).empty());
  EXPECT_EQ(kind(announced(6u << 8 | 3)), std::vector<int>{kData}) << "one has gone";
  EXPECT_EQ(kind(announced(7u << 8 | 3)), std::vector<int>{kGap});
  ASSERT_FALSE(let_in(guard, goodbye()).empty());
  ASSERT_FALSE(let_in(guard, announcement(participant(100))).empty());
  EXPECT_EQ(kind(announced(7u << 8 | 3)), std::vector<int>{kData}) << "it has left and come again";
}

TEST(Guard, AReaderOfAllPartitionsIsNotHeard) {
  const auto of_partition = [](const std::string& name) {
    PacketBytes value;
    test::put32(value, 1);
    test::put32(value, static_cast<std::uint32_t>(name.size() + 1));
    value.insert(value.end(), name.begin(), name.end());
    do {
      value.push_back(0);
    } while (value.size() % 4 != 0);
    return fate(announcement(writer().add(0x0029, value), kSubscriptions));
  };
  for (const char* name : {"*", "vict*", "[a-z]*-1", "client-?"})
    EXPECT_EQ(of_partition(name), Dropped::kWildcard);
  EXPECT_EQ(of_partition("client-7.a_b"), kPasses);
  EXPECT_EQ(of_partition(std::string(41, 'a')), kPasses) << "a length is no wildcard";
}

TEST(Guard, SecuredMessagesPassWhenTheyHaveHeadAndTail) {
  PacketBytes tail(16);
  test::put32(tail, 0);
  PacketBytes secret = {0, 0, 0, 8};
  secret.resize(12);
  EXPECT_EQ(fate(from()
                     .submessage(kSecurePrefix, 1, PacketBytes(20))
                     .submessage(kSecureBody, 1, secret)
                     .submessage(kSecurePostfix, 1, tail)
                     .bytes()),
            kPasses);
  EXPECT_EQ(fate(from().submessage(kSecurePrefix, 1, PacketBytes(20)).bytes()), Dropped::kSecurity);
  EXPECT_EQ(fate(from()
                     .submessage(kSecurePrefix, 1, PacketBytes(8))
                     .submessage(kSecurePostfix, 1, tail)
                     .bytes()),
            Dropped::kSecurity);
  PacketBytes many = tail;
  many[16] = 0x7f;
  EXPECT_EQ(fate(from().submessage(kSecurePostfix, 1, many).bytes()), Dropped::kSecurity)
      << "codes that are not there";
  secret[0] = 0xff;
  EXPECT_EQ(
      fate(from().submessage(kSecureBody, 1, secret).submessage(kSecurePostfix, 1, tail).bytes()),
      Dropped::kSecurity);
}

std::vector<PacketBytes> everything() {
  return {
      announcement(participant().locator(0x0032, 7).add(0x002c, {4, 0, 0, 0, 1, 2, 3, 4})),
      announcement(writer().text(0x0062, "name").add(0x0073, {1, 0, 0, 0, 0, 0}), kPublications),
      with(0x0029, {1, 2, 0x41}, kSubscriptions),
      with(0x1001, {1, 0, 1, 1, 0, 1, 0, 0}, kAnnouncer),
      with(0x0075, {1, 2, 3}),
      from()
          .to(kOther)
          .data({0, kUserWriter, 1, ParameterList().guid(0x0070, kSource, 1).bytes(), kSample})
          .bytes(),
      from()
          .submessage(0x09, 1, PacketBytes(8))
          .data({0, kUserWriter, 2, {}, kSample})
          .heartbeat(0, kUserWriter, 1, 2, 1)
          .bytes(),
      from().fragments({0, kUserWriter, 3, 1, 1, 64, 256, PacketBytes(64)}).bytes(),
      from().gap(0, kUserWriter, 4, 6).acknack(kUserReader, kUserWriter, 3, 40, 2).bytes(),
      from().nack_frag(kUserReader, kUserWriter, 3, 2, 1).bytes(),
      from()
          .data({0, kUserWriter, 5, {}, kSample})
          .submessage(kStatistics, 1, PacketBytes(56))
          .bytes(),
      from()
          .submessage(kSecurePrefix, 1, PacketBytes(20))
          .submessage(kSecurePostfix, 1, PacketBytes(20))
          .bytes()};
}

constexpr Prefix kRelay = {0x44, 0x53, 0, 0x5f, 0x45, 0x50, 0x52, 0x4f, 0x53, 0x49, 0x4d, 0x41};
constexpr std::uint32_t kRelayAddress = 0x0a010003;
constexpr std::uint64_t kRelaySocket = std::uint64_t{11811} << 32 | kRelayAddress;
Guard beside_a_relay() { return Guard(kMaxTextSample, nullptr, {{kRelay, kRelayAddress}}); }

/// `list` as `relay` passes it on, with the sequence number 7.
PacketBytes passed_on(const ParameterList& list, const Prefix& relay = kRelay) {
  return Packet(relay).data({0x000100c7, kAnnouncer, 7, {}, list.payload()}).bytes();
}

TEST(Guard, ADiscoveryServerAnnouncesOthers) {
  Guard guard = beside_a_relay();
  const PacketBytes announced = passed_on(participant());
  const auto whole = guard.check(announced, kRelaySocket);
  ASSERT_TRUE(whole);
  EXPECT_TRUE(std::equal(whole->begin(), whole->end(), announced.begin(), announced.end()));
  const PacketBytes leaves =
      ParameterList().guid(0x0070, kSource, 0x000001c1).add(0x0071, {0, 0, 0, 3}).bytes();
  EXPECT_TRUE(
      guard.check(Packet(kRelay).data({0, kAnnouncer, 8, leaves, {}}).bytes(), kRelaySocket))
      << "they leave";
}

TEST(Guard, NobodyElseDoesSoInItsName) {
  Guard guard = beside_a_relay();
  Prefix second = kRelay;
  second[2] = 1;
  EXPECT_EQ(fate(guard, passed_on(participant())), Dropped::kSource) << "from another address";
  EXPECT_FALSE(guard.check(passed_on(participant(), second), kRelaySocket)) << "another number";
  EXPECT_FALSE(guard.check(passed_on(participant(), kOther), kRelaySocket)) << "from its address";
  EXPECT_EQ(guard.counts().of(Dropped::kSource), 3u);
  Guard usual(kMaxTextSample);
  EXPECT_FALSE(usual.check(passed_on(participant()), kRelaySocket))
      << "who asks no discovery server has none";
}

TEST(Guard, WhatADiscoveryServerMayNotPassOnIsSaidNotToExist) {
  Guard guard = beside_a_relay();
  PacketBytes too_long;  // user data of more bytes than it has
  test::put32(too_long, 0xfffffff0);
  const PacketBytes hostile = passed_on(participant().add(0x002c, too_long));
  const auto whole = guard.check(hostile, kRelaySocket);
  ASSERT_TRUE(whole) << "all that follows would wait for it";
  const PacketBytes gap = Packet(kRelay).gap(0x000100c7, kAnnouncer, 7, 8).bytes();
  const std::size_t length = kHeaderBytes + 2;  // the rest of the announcement stays behind it
  ASSERT_EQ(whole->size(), hostile.size());
  EXPECT_TRUE(std::equal(gap.begin(), gap.begin() + length, whole->begin()));
  EXPECT_TRUE(std::equal(gap.begin() + length + 2, gap.end(), whole->begin() + length + 2));
  Guard library_side(kMaxTextSample);
  EXPECT_TRUE(library_side.check(*whole, kSocket));
}

TEST(Guard, ManyServersBehindOneDiscoveryServerAreNoFlood) {
  Guard guard = beside_a_relay();
  for (unsigned char i = 0; i < 100; ++i) {
    Prefix one = kSource;
    one[11] = i;
    const auto list = ParameterList().guid(0x0050, one, 0x000001c1);
    EXPECT_TRUE(guard.check(passed_on(list), kRelaySocket)) << int{i};
  }
}

// Also the promise to the library: whatever passes is whole, and passes again.
TEST(Guard, AMillionMutatedPacketsAreReadWithinTheirBytes) {
  const std::vector<PacketBytes> corpus = everything();
  std::mt19937 random(7);
  Guard guard(kMaxTextSample);
  int passed = 0;
  for (int run = 0; run < 1'000'000; ++run) {
    PacketBytes message = corpus[random() % corpus.size()];
    const int changes = static_cast<int>(random() % 4);
    for (int i = 0; i < changes; ++i) {
      message[random() % message.size()] =
          random() % 4 == 0 ? 0xff : static_cast<unsigned char>(random());
    }
    if (random() % 8 == 0) message.resize(random() % (message.size() + 1));
    message.shrink_to_fit();  // a sanitizer sees the byte behind it
    guard.sent(message);
    const auto whole = guard.check(message, random() % 1000);
    if (!whole) continue;
    ++passed;
    ASSERT_LE(whole->size(), message.size());
    Bytes rest = whole->subspan(kHeaderBytes);
    while (!rest.empty()) ASSERT_TRUE(next_submessage(rest)) << "run " << run;
  }
  EXPECT_GT(passed, 100'000);
  EXPECT_GT(guard.counts().all(), 100'000u);
}

}  // namespace
}  // namespace trammel::wire
