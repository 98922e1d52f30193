#include "server/dds/processor_share.h"

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

TEST(ProcessorShare, ThreadsThatQueueForTheProcessorAreGivenPartOfIt) {
  double share = 1;
  std::thread([&share] {
    stay_on_one_processor();
    std::atomic<bool> enough{false};
    std::vector<std::jthread> busy;
    for (int i = 0; i < 4; ++i) {
      busy.emplace_back([&enough] {
        while (!enough) continue;
      });
    }
    ProcessorShare given;
    for (int i = 0; i < 100 && share > 0.5; ++i) {  // four want all of one: about a quarter
      ::poll(nullptr, 0, 20);
      share = given.since_last();
    }
    enough = true;
  }).join();
  EXPECT_LE(share, 0.5);
  EXPECT_GE(share, ProcessorShare::kLeast);
}

TEST(ProcessorShare, ThreadsThatWaitForALockWantNone) {
  // Other programs may crowd the machine while this one wakes up: one look of many is undisturbed.
  ProcessorShare given;
  double share = 0;
  for (int i = 0; i < 1000 && share < 0.9; ++i) {
    ::poll(nullptr, 0, 5);
    share = given.since_last();
  }
  EXPECT_GE(share, 0.9);
}

}  // namespace
}  // namespace trammel
