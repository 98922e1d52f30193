#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/base/result.h"

namespace trammel {
namespace {
Result<std::unique_ptr<int>> made(bool well) {
  if (!well) return refused("it is broken").in("part.csv");
  return std::make_unique<int>(3);
}

Result<int> doubled(bool well) {
  const std::unique_ptr<int> part = TRY(made(well));
  return 2 * *part;
}

Status looked_at(bool well) {
  TRY(doubled(well));
  return {};
}

TEST(Try, HandsOutTheValueAlsoWhereItCanOnlyBeMoved) { EXPECT_EQ(doubled(true), 6); }

TEST(Try, LeavesTheFunctionWithTheErrorAsItWas) {
  const Result<int> failed = doubled(false);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().file, "part.csv");
  EXPECT_EQ(failed.error().code, ErrorCode::kRefused);
  EXPECT_FALSE(looked_at(false));
  EXPECT_TRUE(looked_at(true));
}

TEST(Try, ANamedResultKeepsItsValue) {
  const auto both = []() -> Result<std::string> {
    const Result<std::string> named =
        std::string("a long text that is not kept inside of the string itself");
    const std::string once = TRY(named);
    return once + *named;
  };
  EXPECT_EQ(both()->size(),
            2 * std::string("a long text that is not kept inside of the string itself").size());
}

}  // namespace
}  // namespace trammel
