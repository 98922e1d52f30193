// Packets that end, stop or flood the library, each sent from a plain socket to a participant with
// the guard and to one without it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/daemon.h"
#include "tests/support/killed_clients.h"
#include "tests/support/mutated_packets.h"
#include "tests/support/raw_participant.h"
#include "tests/support/victim.h"

namespace trammel {
namespace {

using test::PacketBytes;
using test::ParameterList;
using test::RawParticipant;
using test::Victim;

constexpr std::chrono::seconds kLimit{20};
constexpr std::uint32_t kWriter = 0x00000103;
constexpr std::uint32_t kAll = 0xffffffffu;
constexpr std::size_t kMuchMemory_mib = 300;

/// False when it could not be carried out.
using Attack = std::function<bool(RawParticipant&)>;

/// The state of the participant after it: empty when it goes on as before.
std::string harm_of(const Attack& attack, bool guarded) {
  Victim victim(guarded);
  RawParticipant attacker(victim.port(), Victim::kDomain);
  if (!attacker.meet(kLimit)) return "nobody was there before";
  const std::size_t before_mib = victim.peak_mib();
  if (!attack(attacker)) return "the attack was not carried out";
  // Twice: the first may be answered before the attack is looked at.
  const auto limit = guarded ? kLimit : std::chrono::seconds(4);
  const bool answers = victim.answers(limit) && victim.answers(limit);
  if (victim.is_dead()) return "it has ended";
  if (!answers) return "it does not answer";
  if (victim.peak_mib() > before_mib + kMuchMemory_mib) return "it has taken much memory";
  return "";
}

void expect_only_the_library_is_harmed_by(const Attack& attack) {
  const std::string harm = harm_of(attack, false);
  EXPECT_NE(harm, "") << "the packet does nothing: the guard need not drop it";
  EXPECT_EQ(harm.find("the attack"), std::string::npos) << harm;
  EXPECT_EQ(harm_of(attack, true), "");
}

PacketBytes words(const std::vector<std::uint32_t>& values) {
  PacketBytes bytes;
  for (const std::uint32_t value : values) test::put32(bytes, value);
  return bytes;
}

/// An announcement of itself with one parameter more.
Attack announces(std::uint16_t parameter, const PacketBytes& value) {
  return [=](RawParticipant& attacker) {
    attacker.send(attacker.packet()
                      .data({0,
                             test::kAnnouncerId,
                             2,
                             {},
                             attacker.announcement().add(parameter, value).payload()})
                      .bytes());
    return true;
  };
}

/// An announcement of a writer with one parameter more.
Attack announces_writer(std::uint16_t parameter, const PacketBytes& value) {
  return [=](RawParticipant& attacker) {
    const auto list = attacker.endpoint(kWriter, "Topic", "Type").add(parameter, value);
    attacker.send(
        attacker.packet()
            .data({test::kPublicationsReader, test::kPublicationsId, 1, {}, list.payload()})
            .bytes());
    return true;
  };
}

Attack writes(const std::function<test::Packet&(test::Packet&)>& what) {
  return [=](RawParticipant& attacker) {
    if (!attacker.become_writer(kWriter, kLimit)) return false;
    test::Packet packet = attacker.packet();
    attacker.send_data(what(packet).bytes());
    return true;
  };
}

TEST(HostilePackets, AStatisticsSubmessageThatIsNotTheLast) {
  expect_only_the_library_is_harmed_by([](RawParticipant& attacker) {
    attacker.send(test::Packet(attacker.prefix())
                      .submessage(0x80, 1, PacketBytes(56))
                      .submessage(0x01, 1, {})
                      .bytes());
    return true;
  });
}

TEST(HostilePackets, AGapOver2To62Numbers) {
  expect_only_the_library_is_harmed_by(writes([](test::Packet& p) -> test::Packet& {
    return p.gap(0, kWriter, 1, std::int64_t{1} << 62);
  }));
}

TEST(HostilePackets, AGapOver2To46Numbers) {
  expect_only_the_library_is_harmed_by(writes([](test::Packet& p) -> test::Packet& {
    return p.gap(0, kWriter, 1, std::int64_t{1} << 46);
  }));
}

TEST(HostilePackets, AHeartbeatThatSkips2To46Numbers) {
  expect_only_the_library_is_harmed_by(writes([](test::Packet& p) -> test::Packet& {
    return p.heartbeat(0, kWriter, std::int64_t{1} << 46, std::int64_t{1} << 46, 1);
  }));
}

TEST(HostilePackets, ASampleOf4GigabytesInFragments) {
  expect_only_the_library_is_harmed_by(writes([](test::Packet& p) -> test::Packet& {
    return p.fragments({0, kWriter, 1, 1, 1, 16, 2'000'000'000u, PacketBytes(16)});
  }));
}

TEST(HostilePackets, FourBillionDataRepresentations) {
  expect_only_the_library_is_harmed_by(announces_writer(0x0073, words({kAll, 0})));
}

TEST(HostilePackets, FourBillionDataSharingDomains) {
  expect_only_the_library_is_harmed_by(announces_writer(0x8006, words({kAll, 0})));
}

TEST(HostilePackets, APartitionThatLeadsOutOfMemory) {
  expect_only_the_library_is_harmed_by([](RawParticipant& attacker) {
    // Each distance beyond the parameter: one of them ends where the position wraps around.
    for (std::uint32_t back = 4; back <= 1024; back += 4) {
      const std::uint32_t number = back / 4;
      const auto list = attacker.endpoint(kWriter + (number << 8), "Topic", "Type");
      const PacketBytes value = words({kAll, 0u - back, 0x41414141u, 0});
      attacker.send(attacker.packet()
                        .data({test::kPublicationsReader,
                               test::kPublicationsId,
                               number,
                               {},
                               ParameterList(list).add(0x0029, value).payload()})
                        .bytes());
    }
    return true;
  });
}

TEST(HostilePackets, FourBillionPropertiesOfAToken) {
  expect_only_the_library_is_harmed_by(announces(0x1001, words({1, 0, 30'000'000, 0})));
}

/// The daemon's answers to a client about itself.
std::string answers_of(const test::Daemon& daemon) {
  const auto session = client::Session::open(daemon.session_options());
  if (!session) return session.error().message;
  const auto models = (*session)->models("cell-7");
  const auto jobs = (*session)->jobs("");
  client::CallContext context;
  context.cell = "cell-7";
  const auto error = (*session)->predict_error(context, {{0.1, 0.2, 0.3, 0.4, 0.5, 0.6}});
  return fmt::format("{} models, {} jobs, {}", models ? static_cast<int>(models->size()) : -1,
                     jobs ? static_cast<int>(jobs->size()) : -1,
                     error ? "a model" : error.error().message);
}

TEST(HostilePackets, ADaemonIsAliveAndRightAfter300000MutatedOnes) {
  test::Daemon daemon;
  daemon.start();
  const std::string before = answers_of(daemon);
  for (unsigned seed = 1; seed <= 3; ++seed) {
    test::MutatedPackets packets(daemon.port(), daemon.domain(), seed);
    ASSERT_TRUE(packets.collect());
    packets.send(100'000);
  }
  EXPECT_EQ(answers_of(daemon), before);
  EXPECT_TRUE(daemon.process().wait_for_line("packets were dropped unread", kLimit))
      << "and says what it met";
  EXPECT_EQ(daemon.stop(), 0) << daemon.process().standard_error();
}

/// Announces participants that are not there, twice each, sixteen from a socket, with leases of 4
/// s.
void invent(const test::Daemon& daemon, int participants) {
  std::unique_ptr<RawParticipant> from;
  for (int i = 0; i < participants; ++i) {
    if (i % 16 == 0)
      from = std::make_unique<RawParticipant>(daemon.port(), daemon.domain(),
                                              static_cast<unsigned>(i + 1));
    test::Prefix prefix = from->prefix();
    prefix[11] = static_cast<unsigned char>(i % 16);
    from->set_prefix(prefix);
    const ParameterList announced = from->announcement().add(0x0002, words({4, 0}));
    for (int k = 0; k < 2; ++k)
      from->send(
          test::Packet(prefix).data({0, test::kAnnouncerId, 1, {}, announced.payload()}).bytes());
  }
}

TEST(HostilePackets, AmongTwoThousandInventedParticipantsNewcomersFindTheDaemonAndItOutlivesThem) {
  test::Daemon daemon;
  daemon.start();
  const std::string before = answers_of(daemon);
  for (int round = 0; round < 3; ++round) {
    invent(daemon, 1000);
    EXPECT_EQ(answers_of(daemon), before) << "somebody new";
  }
  // Their leases end meanwhile.
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(8);
  const auto session = client::Session::open(daemon.session_options()).value();
  while (std::chrono::steady_clock::now() < until) ASSERT_TRUE(session->models("cell-7"));
  EXPECT_EQ(daemon.stop(), 0) << daemon.process().standard_error();
}

TEST(HostilePackets, AnAnnouncementThatNamesSocketsOfOthersSendsThemNextToNothing) {
  test::Daemon daemon;
  daemon.start();
  std::vector<std::unique_ptr<RawParticipant>> others;
  for (unsigned i = 0; i < 16; ++i)
    others.push_back(std::make_unique<RawParticipant>(daemon.port(), daemon.domain(), i + 1));
  RawParticipant stranger(daemon.port(), daemon.domain(), 99);
  ParameterList names = stranger.announcement();
  for (const auto& other : others) names.locator(0x0032, other->own_port());
  stranger.send(test::Packet(stranger.prefix())
                    .data({0, test::kAnnouncerId, 1, {}, names.payload()})
                    .bytes());
  int datagrams = 0;
  const auto session = client::Session::open(daemon.session_options()).value();
  for (int i = 0; i < 3; ++i) {
    for (const auto& other : others) {
      while (other->receive(std::chrono::milliseconds(60))) ++datagrams;
    }
    EXPECT_TRUE(session->models("cell-7"));
  }
  EXPECT_LE(datagrams, 8);
}

// Its watchdog ends a daemon that no longer hears itself.
TEST(HostilePackets, WhatIsSaidInTheDaemonsOwnNameDoesNotMakeItDeafToItself) {
  test::Daemon daemon;
  daemon.start();
  RawParticipant stranger(daemon.port(), daemon.domain());
  ASSERT_TRUE(stranger.meet(kLimit));
  const auto session = client::Session::open(daemon.session_options()).value();
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(6);
  for (std::uint32_t count = 1000; std::chrono::steady_clock::now() < until; ++count) {
    for (std::uint32_t writer = 1; writer <= 60; ++writer) {
      for (const std::uint32_t kind : {2u, 3u}) {
        test::Packet skips(stranger.peer());
        skips.to(stranger.peer()).heartbeat(0, writer << 8 | kind, 1 << 19, 1 << 19, count);
        stranger.send(skips.bytes());
      }
    }
    ASSERT_TRUE(session->models("cell-7"));
  }
  EXPECT_EQ(daemon.stop(), 0) << daemon.process().standard_error();
}

TEST(HostilePackets, HonestClientsLoseNothingWhileOthersAreKilled) {
  test::Daemon daemon;
  daemon.start();
  test::KillLoad load;
  load.server = daemon.session_options();
  load.kills = 150;
  const test::KillOutcome outcome = test::kill_clients(load);
  EXPECT_EQ(outcome.killed, load.kills);
  EXPECT_GT(outcome.calls, 20u);
  EXPECT_EQ(outcome.lost, 0u);
  EXPECT_EQ(daemon.stop(), 0) << daemon.process().standard_error();
}

}  // namespace
}  // namespace trammel
