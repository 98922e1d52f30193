// Neither of two participants keeps what the other one has forgotten.
#include "idl/repairs/lost_leases.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace trammel::wire {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kLease{2000}, kStep{50};
constexpr LostLeases::Prefix kLostLeasesOther = {1, 15, 9}, kNext = {1, 15, 8};
constexpr std::uint64_t kLostLeasesSocket = std::uint64_t{17500} << 32 | 0x7f000001,
                        kElsewhere = kLostLeasesSocket + 1;
constexpr LostLeases::Time kLostLeasesStart = std::chrono::hours(1);

bool is_silent(LostLeases& leases, std::uint64_t socket, LostLeases::Time now) {
  const auto silent = leases.silent_sockets(now);
  return std::find(silent.begin(), silent.end(), socket) != silent.end();
}

TEST(LostLeases, WhoIsHeardIsTalkedTo) {
  LostLeases leases(kLease);
  leases.announced(kLostLeasesOther, {kLostLeasesSocket}, kLease, kLostLeasesStart);
  for (LostLeases::Time now = kLostLeasesStart; now < kLostLeasesStart + milliseconds(20000);
       now += milliseconds(1800)) {
    leases.awake(now);
    leases.awake(now + milliseconds(900));
    EXPECT_TRUE(leases.lets_in(kLostLeasesOther, now));
    EXPECT_FALSE(is_silent(leases, kLostLeasesSocket, now));
  }
}

TEST(LostLeases, WhoWasNotHeardForItsLeaseIsNeitherHeardNorTalkedToUntilItHasLostOurs) {
  LostLeases leases(kLease);
  leases.announced(kLostLeasesOther, {kLostLeasesSocket}, kLease, kLostLeasesStart);
  LostLeases::Time lost{}, found{};
  for (LostLeases::Time now = kLostLeasesStart + kStep;
       now < kLostLeasesStart + milliseconds(10000); now += kStep) {
    leases.awake(now);
    if (!is_silent(leases, kLostLeasesSocket, now)) {
      if (lost != LostLeases::Time{} && found == LostLeases::Time{}) found = now;
      continue;
    }
    if (lost == LostLeases::Time{}) lost = now;
    EXPECT_FALSE(leases.lets_in(kLostLeasesOther, now))
        << "what is not talked to is not heard either";
  }
  EXPECT_LE(lost - kLostLeasesStart, kLease);
  EXPECT_GE(lost - kLostLeasesStart, kLease - milliseconds(200));
  EXPECT_GE(found - lost, kLease + milliseconds(200));
  EXPECT_LE(found - lost, kLease + milliseconds(1000));
  EXPECT_TRUE(leases.lets_in(kLostLeasesOther, found));
}

TEST(LostLeases, ALongerLeaseIsWaitedFor) {
  LostLeases leases(kLease);
  leases.announced(kLostLeasesOther, {kLostLeasesSocket}, milliseconds(10000), kLostLeasesStart);
  EXPECT_TRUE(leases.lets_in(kLostLeasesOther, kLostLeasesStart + milliseconds(9000)));
  EXPECT_TRUE(is_silent(leases, kLostLeasesSocket, kLostLeasesStart + milliseconds(19500)));
}

TEST(LostLeases, WhoSleptForgetsEverybodyAndIsForgotten) {
  LostLeases leases(kLease);
  leases.awake(kLostLeasesStart);
  leases.announced(kLostLeasesOther, {kLostLeasesSocket}, milliseconds(10000), kLostLeasesStart);
  const auto woken = kLostLeasesStart + milliseconds(3000);
  leases.awake(woken);
  EXPECT_FALSE(leases.lets_in(kLostLeasesOther, woken));
  EXPECT_FALSE(leases.lets_in(kLostLeasesOther, kLostLeasesStart + milliseconds(10400)))
      << "until our side has lost it, too";
  EXPECT_TRUE(is_silent(leases, kLostLeasesSocket, kLostLeasesStart + milliseconds(10400)));
  LostLeases::Time now = woken;
  while (now < kLostLeasesStart + milliseconds(30000) && !leases.lets_in(kLostLeasesOther, now))
    leases.awake(now += kStep);
  EXPECT_LT(now, kLostLeasesStart + milliseconds(13000));
}

TEST(LostLeases, WhatListensWhereAnotherOneDidIsTalkedTo) {
  LostLeases leases(kLease);
  leases.announced(kLostLeasesOther, {kLostLeasesSocket, kElsewhere}, kLease, kLostLeasesStart);
  const auto later = kLostLeasesStart + milliseconds(2500);
  leases.announced(kNext, {kLostLeasesSocket}, kLease, later);
  EXPECT_FALSE(is_silent(leases, kLostLeasesSocket, later));
  EXPECT_TRUE(is_silent(leases, kElsewhere, later));
  EXPECT_TRUE(leases.lets_in(kNext, later));
}

TEST(LostLeases, WhoLeftIsNotMissed) {
  LostLeases leases(kLease);
  leases.announced(kLostLeasesOther, {kLostLeasesSocket}, kLease, kLostLeasesStart);
  leases.left(kLostLeasesOther);
  EXPECT_FALSE(is_silent(leases, kLostLeasesSocket, kLostLeasesStart + milliseconds(2500)));
  EXPECT_TRUE(leases.lets_in(kLostLeasesOther, kLostLeasesStart + milliseconds(2500)));
}

/// Two sides that announce themselves every 200 ms, packets lost one way for a while: whatever the
/// moment and the length of that, in the end each has lost the other as often as it was lost, or
/// they found each other after both had.
TEST(LostLeases, BothSidesFindEachOtherAgainAfterBothHaveLostEachOther) {
  struct Side {
    LostLeases leases{kLease};
    LostLeases::Time library_heard = kLostLeasesStart;
    bool library_knows = true;
    int found = 0;
  };
  for (int first_lost = 1500; first_lost < 2300; first_lost += 37) {
    for (int length = 500; length < 6000; length += 113) {
      Side a, b;
      a.leases.announced(kLostLeasesOther, {kLostLeasesSocket}, kLease, kLostLeasesStart);
      b.leases.announced(kNext, {kElsewhere}, kLease, kLostLeasesStart);
      const auto pass = [](Side& from, const LostLeases::Prefix& prefix, std::uint64_t socket,
                           Side& to, std::uint64_t to_socket, LostLeases::Time now) {
        if (is_silent(from.leases, to_socket, now) || !to.leases.lets_in(prefix, now)) return;
        to.leases.announced(prefix, {socket}, kLease, now);
        if (!to.library_knows) ++to.found;
        to.library_knows = true;
        to.library_heard = now;
      };
      for (int ms = 200; ms < 20000; ms += 10) {
        const auto now = kLostLeasesStart + milliseconds(ms);
        for (Side* side : {&a, &b}) {
          side->leases.awake(now);
          if (now - side->library_heard >= kLease) side->library_knows = false;
        }
        const bool cut = ms >= first_lost && ms < first_lost + length;
        if (ms % 200 == 0 && !cut) pass(a, kNext, kElsewhere, b, kLostLeasesSocket, now);
        if (ms % 200 == 70) pass(b, kLostLeasesOther, kLostLeasesSocket, a, kElsewhere, now);
      }
      EXPECT_TRUE(a.library_knows && b.library_knows) << first_lost << " " << length;
      EXPECT_EQ(a.found, b.found) << first_lost << " " << length;
    }
  }
}

}  // namespace
}  // namespace trammel::wire
