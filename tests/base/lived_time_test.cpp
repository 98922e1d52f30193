#include "server/base/lived_time.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <sched.h>

#include <atomic>
#include <thread>
#include <vector>

namespace trammel {
namespace {

/// Runs the calling thread, and those that it starts, on one of the processors it has.
void stay_on_one_processor() {
  cpu_set_t mine;
  CPU_ZERO(&mine);
  ASSERT_EQ(::sched_getaffinity(0, sizeof mine, &mine), 0);
  int first = 0;
  while (!CPU_ISSET(first, &mine)) ++first;
  CPU_ZERO(&mine);
  CPU_SET(first, &mine);
  ASSERT_EQ(::sched_setaffinity(0, sizeof mine, &mine), 0);
}

using std::chrono::milliseconds;

constexpr std::uint64_t kMs = 1'000'000;
constexpr milliseconds kLook{20};

/// The share of 250 ms that began with all threads at 0.
double share_of(std::initializer_list<ThreadTimes> after) {
  const std::vector<ThreadTimes> threads(after);
  return processor_share({}, threads, milliseconds(250));
}

TEST(ProcessorShare, ThreadsThatWantNoneOrGetWhatTheyWantHaveAllOfIt) {
  EXPECT_EQ(share_of({}), 1) << "the system says nothing";
  EXPECT_EQ(share_of({{1, 0, 0}, {2, 250 * kMs, 0}}), 1);
}

TEST(ProcessorShare, WhatAllWaitedForIsNoTimeOfTheirs) {
  EXPECT_DOUBLE_EQ(share_of({{1, 10 * kMs, 30 * kMs}, {2, 10 * kMs, 30 * kMs}}), 0.25);
}

TEST(ProcessorShare, AThreadThatGotNoneIsNotHiddenByOthersThatRan) {
  EXPECT_NEAR(share_of({{1, 250 * kMs, 0}, {2, 250 * kMs, 0}, {3, 0, 240 * kMs}}), 0.04, 1e-9);
}

TEST(ProcessorShare, WhatWasBeforeIsLeftOutAndAThreadThatEndedOrBeganDoesNoHarm) {
  const std::vector<ThreadTimes> before = {{1, 900 * kMs, 900 * kMs}, {2, 7 * kMs, 5 * kMs}};
  const std::vector<ThreadTimes> after = {{2, 17 * kMs, 5 * kMs}, {3, 10 * kMs, 20 * kMs}};
  EXPECT_DOUBLE_EQ(processor_share(before, after, milliseconds(250)), 0.5);
}

TEST(LivedTime, ThreadsThatQueueForTheProcessorLivePartOfTheTime) {
  milliseconds lived{1000};
  std::thread([&lived] {
    stay_on_one_processor();
    std::atomic<bool> enough{false};
    std::vector<std::jthread> busy;
    for (int i = 0; i < 4; ++i) {
      busy.emplace_back([&enough] {
        while (!enough) continue;
      });
    }
    LivedTime time(kLook);
    for (int i = 0; i < 100 && lived > kLook / 2; ++i) {  // four want all of one: about a quarter
      ::poll(nullptr, 0, static_cast<int>(kLook.count()));
      lived = time.since_last();
    }
    enough = true;
  }).join();
  EXPECT_LE(lived, kLook / 2);
  EXPECT_GE(lived, kLook / 4);
}

TEST(LivedTime, ThreadsThatWaitForALockLiveAllOfIt) {
  // Other programs may crowd the machine while this one wakes up: one look of many is undisturbed.
  LivedTime time(kLook);
  milliseconds lived{0};
  for (int i = 0; i < 1000 && lived < kLook * 9 / 10; ++i) {
    ::poll(nullptr, 0, static_cast<int>(kLook.count()));
    lived = time.since_last();
  }
  EXPECT_GE(lived, kLook * 9 / 10);
}

TEST(LivedTime, OfALookThatComesLateOneTickCounts) {
  LivedTime time(milliseconds(5));
  ::poll(nullptr, 0, 100);
  EXPECT_LE(time.since_last(), milliseconds(5));
}

}  // namespace
}  // namespace trammel
