#include "clients/cli/text/tolerance.h"

#include <gtest/gtest.h>

#include <limits>

namespace trammel::cli {
namespace {

constexpr double kToleranceMm = 0.2;
const ExpectedError kInside{1.0, 0.02, 0.01};

Status held(const std::vector<ExpectedError>& targets) {
  return check_strictly("", tolerance_verdict(targets, kToleranceMm));
}

std::string why(const Status& status) { return status ? "" : status.error().message; }

TEST(StrictTolerance, IsHeldWhereEveryTargetIsInsideAndInDomain) {
  EXPECT_TRUE(held({kInside, kInside}));
  EXPECT_TRUE(check_strictly("", std::nullopt)) << "no tolerance was asked for";
}

TEST(StrictTolerance, OneTargetOutsideIsRefusedAndCounted) {
  const Status answer = held({kInside, {1.0, 0.5, 0.1}, kInside});
  ASSERT_FALSE(answer);
  EXPECT_NE(why(answer).find("nothing is written"), std::string::npos) << why(answer);
  EXPECT_NE(why(answer).find("2 of 3 targets are inside"), std::string::npos) << why(answer);
}

TEST(StrictTolerance, ATargetOutOfDomainIsRefusedHoweverSmallItsExpectedError) {
  ExpectedError outside = kInside;
  outside.in_domain = false;
  const Status answer = held({outside, kInside, outside});
  ASSERT_FALSE(answer);
  EXPECT_NE(why(answer).find("2 are out of domain"), std::string::npos) << why(answer);
}

TEST(StrictTolerance, ATargetOfUnknownErrorIsRefused) {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(held({kInside, {unknown, unknown, unknown}}));
}

TEST(StrictTolerance, WhatIsLeftAsItWasIsRefusedWithoutATolerance) {
  const Status answer =
      check_strictly("1 of 2 targets are left as they were:\n  row 2: unreachable\n", std::nullopt);
  ASSERT_FALSE(answer);
  EXPECT_NE(why(answer).find("1 of 2 targets are left as they were"), std::string::npos)
      << why(answer);
}

}  // namespace
}  // namespace trammel::cli
