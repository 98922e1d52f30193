#include "server/store/clock_watch.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr milliseconds kThen = seconds(1'800'000'000);

ClockWatch::Time at(seconds since_boot, milliseconds set_by) {
  return {kThen + since_boot + set_by, since_boot};
}

TEST(ClockWatch, WhatPassesIsNoStep) {
  ClockWatch clock(at(seconds(10), seconds(0)));
  for (int hour = 1; hour < 100; ++hour)
    EXPECT_FALSE(clock.look(at(seconds(10 + 3600 * hour), seconds(0))));
  EXPECT_EQ(clock.off(), seconds(0));
}

TEST(ClockWatch, AStepIsToldOnceAndHowFarItIsOffStays) {
  ClockWatch clock(at(seconds(10), seconds(0)));
  EXPECT_EQ(clock.look(at(seconds(11), seconds(-3600))), seconds(-3600));
  EXPECT_FALSE(clock.look(at(seconds(12), seconds(-3600))));
  EXPECT_EQ(clock.off(), seconds(-3600));
  EXPECT_EQ(clock.look(at(seconds(13), seconds(0))), seconds(3600));
  EXPECT_EQ(clock.off(), seconds(0));
}

TEST(ClockWatch, SmallStepsAreToldOnceTheyAddUp) {
  ClockWatch clock(at(seconds(0), seconds(0)));
  EXPECT_FALSE(clock.look(at(seconds(1), milliseconds(900))));
  EXPECT_FALSE(clock.look(at(seconds(2), milliseconds(1800))));
  EXPECT_EQ(clock.look(at(seconds(3), milliseconds(2700))), seconds(3));
}

TEST(ClockWatch, OneBefore1970IsAStepLikeAnother) {
  ClockWatch clock(at(seconds(0), seconds(0)));
  EXPECT_EQ(clock.look(at(seconds(1), seconds(-3'000'000'000))), seconds(-3'000'000'000));
}

}  // namespace
}  // namespace trammel
