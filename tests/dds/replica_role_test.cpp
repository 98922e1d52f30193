#include "server/dds/replicas/replica_role.h"

#include <gtest/gtest.h>

#include <limits>

namespace trammel {
namespace {

using std::chrono::seconds;
using Role = ReplicaOptions::Role;
const ReplicaRole::Time kStart{seconds(1000)};
const ReplicaRole::Time kLater = kStart + seconds(2);

ReplicaOptions writer() { return {Role::kWriter}; }
ReplicaOptions follower(double promote_after_s = 0) { return {Role::kFollower, "a", promote_after_s}; }
OtherReplica writes(const std::string& server, std::uint64_t epoch) { return {server, true, "", epoch}; }
OtherReplica follows(const std::string& server, const std::string& of, std::uint64_t epoch) {
  return {server, false, of, epoch};
}

TEST(ReplicaRole, AFirstStartDoesWhatTheFileSays) {
  EXPECT_TRUE(ReplicaRole("a", writer(), kStart).begin({}).record.writes);
  const RoleDecision begun = ReplicaRole("b", follower(), kStart).begin({});
  EXPECT_FALSE(begun.record.writes);
  EXPECT_EQ(begun.record.follows, "a");
  EXPECT_EQ(begun.record.epoch, 0u);
}

TEST(ReplicaRole, AStartGoesOnWithWhatWasDecidedAfterTheFileWasWritten) {
  const ReplicaRole role("a", writer(), kStart);
  ReplicaRecord stepped_down = role.begin({}).record;
  stepped_down.writes = false;
  stepped_down.follows = "b";
  EXPECT_EQ(role.begin(stepped_down).record, stepped_down);
}

TEST(ReplicaRole, AChangedFilePromotesAndThePromotionIsNewerThanAnyDecision) {
  ReplicaRole role("b", follower(), kStart);
  const ReplicaRecord record{17, false, "a", "follower of a"};
  const RoleDecision told = role.told(record, writer(), {writes("a", 900)});
  EXPECT_TRUE(told.record.writes);
  EXPECT_GT(told.record.epoch, 900u);
  EXPECT_EQ(ReplicaRole("b", writer(), kStart).begin(record).record.epoch, ReplicaRole::kPromotion);
}

TEST(ReplicaRole, WhatAPersonDecidedIsDecidedAgainUntilTheStoreRemembersIt) {
  ReplicaRole role("b", follower(), kStart);
  const ReplicaRecord record{17, false, "a", "follower of a"};
  const RoleDecision told = role.told(record, writer(), {});
  ASSERT_TRUE(told.record.writes);
  const RoleDecision again = role.decide(record, {}, kLater);
  EXPECT_EQ(again.record, told.record) << "as if the disk had been full";
  EXPECT_FALSE(again.why.empty());
  EXPECT_EQ(role.decide(told.record, {}, kLater).record, told.record);
}

TEST(ReplicaRole, AnUnchangedFileDecidesNothingWhileAnotherOneWrites) {
  ReplicaRole role("a", writer(), kStart);
  const ReplicaRecord record{ReplicaRole::kPromotion, false, "b", "writer"};
  EXPECT_FALSE(role.told(record, writer(), {writes("b", ReplicaRole::kPromotion)}).record.writes);
  EXPECT_TRUE(role.told(record, writer(), {follows("c", "b", ReplicaRole::kPromotion)}).record.writes);
}

TEST(ReplicaRole, AnEpochThatSomebodyMadeUpLeavesTheNextOneNewerThanAllOthers) {
  ReplicaRole role("a", follower(), kStart);
  const std::vector<OtherReplica> others = {follows("c", "b", std::numeric_limits<std::uint64_t>::max())};
  const RoleDecision told = role.told({17, false, "b", "follower of b"}, writer(), others);
  EXPECT_TRUE(told.record.writes);
  EXPECT_GT(told.record.epoch, std::numeric_limits<std::uint64_t>::max() / 2);
}

TEST(ReplicaRole, OfTwoThatWriteTheOneWithTheLowerEpochStopsAndBothSaySo) {
  ReplicaRole a("a", writer(), kStart), b("b", writer(), kStart);
  const ReplicaRecord of_a{5, true, "", "writer"}, of_b{9, true, "", "writer"};
  const std::vector<OtherReplica> seen_by_a = {writes("b", 9)}, seen_by_b = {writes("a", 5)};
  const RoleDecision stops = a.decide(of_a, seen_by_a, kLater), goes_on = b.decide(of_b, seen_by_b, kLater);
  EXPECT_FALSE(stops.record.writes);
  EXPECT_EQ(stops.record.follows, "b");
  EXPECT_TRUE(goes_on.record.writes);
  EXPECT_FALSE(stops.trouble.empty());
  EXPECT_FALSE(goes_on.trouble.empty());
}

TEST(ReplicaRole, OfTwoThatAreAsNewOneGoesOn) {
  ReplicaRole a("a", writer(), kStart), b("b", writer(), kStart);
  const ReplicaRecord record{5, true, "", "writer"};
  const std::vector<OtherReplica> seen_by_a = {writes("b", 5)}, seen_by_b = {writes("a", 5)};
  EXPECT_TRUE(a.decide(record, seen_by_a, kLater).record.writes);
  EXPECT_FALSE(b.decide(record, seen_by_b, kLater).record.writes);
}

TEST(ReplicaRole, AWriterWhoseStoreIsOlderThanItsFollowerStops) {
  ReplicaRole a("a", writer(), kStart);
  const std::vector<OtherReplica> others = {follows("b", "a", 8)};
  const RoleDecision decision = a.decide({5, true, "", "writer"}, others, kLater);
  EXPECT_FALSE(decision.record.writes);
  EXPECT_FALSE(decision.why.empty());
}

TEST(ReplicaRole, AFollowerFollowsTheNewestWriterAndNoneThatIsOlderThanItself) {
  ReplicaRole c("c", follower(), kStart);
  const ReplicaRecord record{9, false, "a", "follower of a"};
  const std::vector<OtherReplica> two = {writes("a", 9), writes("b", ReplicaRole::kPromotion)};
  const RoleDecision newest = c.decide(record, two, kLater);
  ASSERT_NE(newest.leader, nullptr);
  EXPECT_EQ(newest.leader->server, "b");
  const std::vector<OtherReplica> old = {writes("a", 8)};
  const RoleDecision stale = c.decide(record, old, kLater);
  EXPECT_EQ(stale.leader, nullptr);
  EXPECT_FALSE(stale.trouble.empty());
}

TEST(ReplicaRole, AFollowerPromotesItselfOnlyWhereTheFileSaysSoAndAfterThatTime) {
  ReplicaRole by_hand("b", follower(), kStart), by_rule("b", follower(5), kStart);
  const ReplicaRecord record{9, false, "a", "follower of a"};
  EXPECT_FALSE(by_hand.decide(record, {}, kStart + seconds(3600)).record.writes);
  EXPECT_FALSE(by_rule.decide(record, {}, kStart + seconds(4)).record.writes);
  EXPECT_TRUE(by_rule.decide(record, {}, kStart + seconds(6)).record.writes);
}

TEST(ReplicaRole, OfSeveralFollowersTheOneWithTheNewestDecisionsIsPromoted) {
  const ReplicaRecord record{9, false, "a", "follower of a"};
  const auto is_promoted = [&](const OtherReplica& other) {
    ReplicaRole role("b", follower(5), kStart);
    const std::vector<OtherReplica> others = {other};
    return role.decide(record, others, kStart + seconds(6)).record.writes;
  };
  EXPECT_FALSE(is_promoted(follows("c", "a", 10)));
  EXPECT_TRUE(is_promoted(follows("c", "a", 9)));
  EXPECT_FALSE(is_promoted(follows("a2", "a", 9)));
}

TEST(ReplicaRole, WhoWasToldToWriteTakesOverFromAWriterThatFollowsItNow) {
  ReplicaRole a("a", writer(), kStart);
  const ReplicaRecord record{ReplicaRole::kPromotion, false, "b", "writer"};
  const std::vector<OtherReplica> handed_over = {follows("b", "a", ReplicaRole::kPromotion)};
  const RoleDecision decision = a.decide(record, handed_over, kLater);
  EXPECT_TRUE(decision.record.writes);
  EXPECT_EQ(decision.record.epoch, 2 * ReplicaRole::kPromotion);
  const std::vector<OtherReplica> newer = {follows("b", "a", ReplicaRole::kPromotion + 1)};
  EXPECT_FALSE(a.decide(record, newer, kLater).record.writes) << "it must first have what was decided";
}

}  // namespace
}  // namespace trammel
