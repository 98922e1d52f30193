#include "clients/session/parts.h"

#include <gtest/gtest.h>

#include <vector>

namespace trammel::client {
namespace {

using Seconds = PartSize::Seconds;

constexpr std::size_t kMost = 2000;

/// A service that takes `per_item` for each item and tells which requests it had.
struct Service {
  Seconds per_item{0.004};
  int version = 1;
  Seconds clock{0};
  std::vector<std::size_t> parts = {};

  Result<exchange::Answer<int>> answer(std::size_t first, std::size_t count) {
    parts.push_back(count);
    clock += per_item * static_cast<double>(count);
    exchange::Answer<int> answer;
    answer.model.version = version;
    for (std::size_t i = first; i < first + count; ++i)
      answer.items.push_back(100000 * version + static_cast<int>(i));
    return answer;
  }
  Result<exchange::Answer<int>> ask(std::size_t items, const AskPart<int>& part) {
    return ask_in_parts<int>(items, "cell-7", PartSize(Seconds(0.5), kMost), part, {},
                             [this] { return clock; });
  }
  Result<exchange::Answer<int>> ask(std::size_t items) {
    return ask(items,
               [this](std::size_t first, std::size_t count) { return answer(first, count); });
  }
};

TEST(Parts, AreAnsweredLongBeforeARequestIsSentAgainHoweverLongATargetTakes) {
  for (const double per_item : {1e-5, 0.004, 0.05, 0.4}) {
    Service service{Seconds(per_item)};
    const auto answer = service.ask(5000);
    ASSERT_TRUE(answer) << answer.error().message;
    ASSERT_EQ(answer->items.size(), 5000U);
    for (int i = 0; i < 5000; ++i)
      EXPECT_EQ(answer->items[static_cast<std::size_t>(i)], 100000 + i);
    for (std::size_t k = 1; k < service.parts.size(); ++k)
      EXPECT_LE(static_cast<double>(service.parts[k]) * per_item, std::max(0.5, per_item) + 1e-6)
          << per_item;
  }
}

TEST(Parts, GrowToTheLargestRequestWhereTargetsAreQuick) {
  Service service{Seconds(1e-6)};
  ASSERT_TRUE(service.ask(20000));
  EXPECT_LE(service.parts.size(), 14U);
  EXPECT_EQ(*std::max_element(service.parts.begin(), service.parts.end()), kMost);
}

TEST(Parts, AProgramIsAnsweredByTheNewModelFromItsBeginningWhereOneIsPutInForceMeanwhile) {
  Service service;
  const auto answer = service.ask(1000, [&](std::size_t first, std::size_t count) {
    if (service.version == 1 && first > 500) service.version = 2;
    return service.answer(first, count);
  });
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->model.version, 2);
  ASSERT_EQ(answer->items.size(), 1000U);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(answer->items[static_cast<std::size_t>(i)], 200000 + i);
}

TEST(Parts, AreGivenUpWhereTheModelChangesAgainAndAgain) {
  Service service;
  const auto answer = service.ask(1000, [&](std::size_t first, std::size_t count) {
    ++service.version;
    return service.answer(first, count);
  });
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::kBusy);
}

TEST(Parts, ARefusalInTheMiddleSaysHowFarItCameAndHandsOutNothing) {
  Service service;
  const auto answer =
      service.ask(1000, [&](std::size_t first, std::size_t count) -> Result<exchange::Answer<int>> {
        if (first > 100) return refused("unknown tool");
        return service.answer(first, count);
      });
  ASSERT_FALSE(answer);
  EXPECT_NE(sentence(answer.error()).find("after the first"), std::string::npos)
      << sentence(answer.error());
}

TEST(Parts, AProgramWhoseLaterTargetsTakeFarLongerIsAnsweredAllTheSame) {
  constexpr double kTimeout = 5;
  Service service;
  const auto answer =
      service.ask(5000, [&](std::size_t first, std::size_t count) -> Result<exchange::Answer<int>> {
        const std::size_t slow =
            first + count > 1200 ? first + count - std::max<std::size_t>(first, 1200) : 0;
        const double takes =
            0.0002 * static_cast<double>(count - slow) + 0.004 * static_cast<double>(slow);
        service.per_item = Seconds(takes / static_cast<double>(count));
        if (takes < kTimeout) return service.answer(first, count);
        service.clock += Seconds(kTimeout);
        return failure(ErrorCode::kUnreachable, "no answer in time");
      });
  ASSERT_TRUE(answer) << sentence(answer.error());
  ASSERT_EQ(answer->items.size(), 5000U);
  for (int i = 0; i < 5000; ++i) EXPECT_EQ(answer->items[static_cast<std::size_t>(i)], 100000 + i);
}

TEST(Parts, AServerThatHasNoTimeForALongPartIsAskedForShorterOnes) {
  Service service{Seconds(1e-5)};
  const auto answer =
      service.ask(5000, [&](std::size_t first, std::size_t count) -> Result<exchange::Answer<int>> {
        if (count > 300)
          return failure(ErrorCode::kBusy, "its {} items would be done too late", count);
        service.per_item = Seconds(0.001);
        return service.answer(first, count);
      });
  ASSERT_TRUE(answer) << sentence(answer.error());
  ASSERT_EQ(answer->items.size(), 5000U);
  for (int i = 0; i < 5000; ++i) EXPECT_EQ(answer->items[static_cast<std::size_t>(i)], 100000 + i);
}

TEST(Parts, AServiceThatIsGoneIsNotAskedForEver) {
  Service service;
  int asked = 0;
  const auto answer =
      service.ask(5000, [&](std::size_t first, std::size_t count) -> Result<exchange::Answer<int>> {
        ++asked;
        if (first == 0) return service.answer(first, count);
        return failure(ErrorCode::kUnreachable, "no answer in time");
      });
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::kUnreachable);
  EXPECT_LE(asked, 5);
}

TEST(Parts, AnEmptyListIsAskedOnce) {
  Service service;
  ASSERT_TRUE(service.ask(0));
  EXPECT_EQ(service.parts.size(), 1U);
}

}  // namespace
}  // namespace trammel::client
