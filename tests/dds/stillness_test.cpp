#include "server/dds/stillness.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

namespace trammel {
namespace {

using std::chrono::milliseconds;
using Mark = std::optional<std::uint64_t>;

constexpr milliseconds kTick{250};
constexpr milliseconds kStillnessLimit{5000};

/// Two parts whose marks the test says.
struct Parts {
  Mark discovery = 0, replying;
  Stillness watched{
      {{"discovery", [this] { return discovery; }}, {"replying", [this] { return replying; }}},
      kTick,
      kStillnessLimit};
  /// What `ticks` looks end with.
  std::string after(int ticks, milliseconds each = kTick) {
    std::string names;
    for (int i = 0; i < ticks; ++i) names = fmt::format("{}", fmt::join(watched.look(each), " "));
    return names;
  }
};

TEST(Stillness, APartThatStopsIsNamedAfterItsLimit) {
  Parts parts;
  EXPECT_EQ(parts.after(1 + 19), "") << "the first look only sees where it stands";
  EXPECT_EQ(parts.after(1), "discovery");
}

TEST(Stillness, APartIsToldBeforeItsLimitAndOneThatEndsNothingIsOnlyTold) {
  Stillness watched(
      {{"status", [] { return Mark(1); }}, {"computing", [] { return Mark(2); }, false}}, kTick,
      kStillnessLimit);
  for (int i = 0; i < 1 + 7; ++i) EXPECT_TRUE(watched.look(kTick).empty());
  EXPECT_EQ(watched.still_for(milliseconds(1750)), 3u) << "a bit each";
  EXPECT_EQ(watched.still_for(milliseconds(2000)), 0u);
  std::vector<const char*> stopped;
  for (int i = 0; i < 100; ++i) stopped = watched.look(kTick);
  ASSERT_EQ(stopped.size(), 1u);
  EXPECT_STREQ(stopped[0], "status");
}

TEST(Stillness, APartThatMovesAtAllHasNotStopped) {
  Parts parts;
  for (int i = 0; i < 100; ++i) {
    ++*parts.discovery;
    ASSERT_EQ(parts.after(19), "");
  }
}

TEST(Stillness, APartWithNothingToDoHasNotStopped) {
  Parts parts;
  parts.discovery.reset();
  EXPECT_EQ(parts.after(1000), "");
  parts.replying = 7;  // one reply, for ever
  EXPECT_EQ(parts.after(20), "");
  EXPECT_EQ(parts.after(1), "replying");
  parts.replying = 8;
  EXPECT_EQ(parts.after(1), "");
}

TEST(Stillness, AProcessThatWasStoppedAndGoesOnHasNotStopped) {
  Parts parts;
  EXPECT_EQ(parts.after(3), "");
  EXPECT_EQ(parts.after(1, std::chrono::hours(1)), "")
      << "an hour in which nobody ran, the watcher neither";
  ++*parts.discovery;
  EXPECT_EQ(parts.after(10), "");
}

TEST(Stillness, OnABusyMachineLateLooksCountAsOneTick) {
  Parts parts;
  EXPECT_EQ(parts.after(20, milliseconds(3000)), "");
  EXPECT_EQ(parts.after(1, milliseconds(3000)), "discovery");
}

TEST(WorkUnderWay, SaysTheOldestPieceUntilItEnds) {
  WorkUnderWay work;
  EXPECT_FALSE(work.oldest());
  std::unique_ptr<WorkUnderWay::Piece> first(new WorkUnderWay::Piece(work.begin()));
  const Mark of_first = work.oldest();
  {
    const WorkUnderWay::Piece second = work.begin();
    EXPECT_EQ(work.oldest(), of_first);
  }
  const WorkUnderWay::Piece third = work.begin();
  EXPECT_EQ(work.oldest(), of_first);
  first.reset();
  EXPECT_NE(work.oldest(), of_first);
  EXPECT_TRUE(work.oldest());
}

TEST(WorkUnderWay, MorePiecesThanPlacesAreNotWatchedButDoNoHarm) {
  WorkUnderWay work;
  std::vector<std::unique_ptr<WorkUnderWay::Piece>> pieces;
  for (int i = 0; i < 1000; ++i) pieces.emplace_back(new WorkUnderWay::Piece(work.begin()));
  EXPECT_EQ(work.oldest(), 1u);
  pieces.clear();
  EXPECT_FALSE(work.oldest());
}

}  // namespace
}  // namespace trammel
