#include "server/base/json_guard.h"

#include <gtest/gtest.h>

#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

std::string repeated(const std::string& part, std::size_t times) {
  std::string text;
  text.reserve(part.size() * times);
  for (std::size_t i = 0; i < times; ++i) text += part;
  return text;
}

Refusal refusal(const std::string& json, const JsonLimits& limits = {}) {
  const Status fine = check_json_limits(json, "x.json", limits);
  return refusal_of(fine);
}

Refusal too_large(double count, double limit) {
  return Refusal("x.json").of(ErrorCode::kTooLarge).beyond(count, limit);
}

TEST(JsonGuard, WhatIsWithinTheLimitsPasses) {
  EXPECT_EQ(refusal("{}"), Refusal::none());
  EXPECT_EQ(refusal(R"({"a": [1, -2.5e-3, "b\"]]]", true, null], "c": {"d": []}})"),
            Refusal::none());
  EXPECT_EQ(refusal(repeated("[", 16) + repeated("]", 16)), Refusal::none());
}

TEST(JsonGuard, TooMuchOfAnythingIsRefusedAndNamedWithItsLimit) {
  JsonLimits limits;
  limits.bytes = 200;
  limits.values = limits.members = limits.containers = 5;
  limits.text_bytes = limits.scalar_bytes = 10;
  EXPECT_EQ(refusal(std::string(201, ' '), limits), too_large(201, 200));
  EXPECT_EQ(refusal(repeated("[", 17)), too_large(17, 16));
  EXPECT_EQ(refusal(repeated("{\"\":", 17)), too_large(17, 16));
  EXPECT_EQ(refusal(repeated("[],", 6), limits), too_large(6, 5));
  EXPECT_EQ(refusal(repeated("1,", 6), limits), too_large(6, 5));
  EXPECT_EQ(refusal(repeated(":", 6), limits), too_large(6, 5));
  EXPECT_EQ(refusal('"' + std::string(20, 'x') + '"', limits), too_large(22, 10));
  EXPECT_EQ(refusal(std::string(20, '7'), limits), too_large(20, 10));
  EXPECT_EQ(refusal("]"), Refusal("x.json"));
}

TEST(JsonGuard, MillionsOfBracketsTakeNeitherStackNorMemory) {
  for (const char* part : {"[", "{\"a\":", "[[],", "\"", "\\", "{\"\\\"", ",", ":"}) {
    static_cast<void>(refusal(repeated(part, 10'000'000)));  // ends, whatever it says
  }
  EXPECT_FALSE(check_json_limits(repeated("[", 30'000'000), "x.json", {}));
}

TEST(JsonGuard, MembersAreTheBytesOfTheText) {
  const std::string json = R"( {"a" : {"x": [1, 2 ]} ,"b":"]}\"" , "c":-1e3, "d": [] } )";
  const auto members = json_members(json, "x.json");
  ASSERT_TRUE(members) << members.error().message;
  ASSERT_EQ(members->size(), 4u);
  EXPECT_EQ(members->at("a"), R"({"x": [1, 2 ]})");
  EXPECT_EQ(members->at("b"), R"("]}\"")");
  EXPECT_EQ(members->at("c"), "-1e3");
  EXPECT_EQ(members->at("d"), "[]");
  EXPECT_TRUE(json_members("{}", "x.json")->empty());
}

TEST(JsonGuard, WhatIsNoObjectHasNoMembers) {
  for (const char* json : {"",
                           "[]",
                           "1",
                           "\"{}\"",
                           "{",
                           "{\"a\"",
                           "{\"a\":",
                           "{\"a\":1",
                           "{\"a\":1,}",
                           "{,}",
                           "{:1}",
                           "{\"a\" 1}",
                           "{\"a\":1}{}",
                           "{\"a\":1} 2",
                           "{1:2}",
                           "{\"a\":1,\"a\":2}",
                           "{\"\\u0061\":1}",
                           "{\"a\":1:2}",
                           "{\"a\"}",
                           "}",
                           "{\"a\":}",
                           "{\"a\":1]"}) {
    EXPECT_FALSE(json_members(json, "x.json")) << json;
  }
}

}  // namespace
}  // namespace trammel
