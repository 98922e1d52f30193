#include "server/base/json_guard.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

std::string repeated(const std::string& part, std::size_t times) {
  std::string text;
  text.reserve(part.size() * times);
  for (std::size_t i = 0; i < times; ++i) text += part;
  return text;
}

std::string message(const std::string& json, const JsonLimits& limits = {}) {
  const Status fine = check_json_limits(json, "x.json", limits);
  return fine ? "" : fine.error().message;
}

TEST(JsonGuard, WhatIsWithinTheLimitsPasses) {
  EXPECT_EQ(message("{}"), "");
  EXPECT_EQ(message(R"({"a": [1, -2.5e-3, "b\"]]]", true, null], "c": {"d": []}})"), "");
  EXPECT_EQ(message(repeated("[", 16) + repeated("]", 16)), "");
}

TEST(JsonGuard, TooMuchOfAnythingIsRefusedAndNamedWithItsLimit) {
  JsonLimits limits;
  limits.bytes = 200;
  limits.values = limits.members = limits.containers = 5;
  limits.text_bytes = limits.scalar_bytes = 10;
  EXPECT_EQ(message(std::string(201, ' '), limits), "x.json: 201 bytes, limit 200");
  EXPECT_EQ(message(repeated("[", 17)), "x.json: 17 arrays and objects inside one another, limit 16");
  EXPECT_EQ(message(repeated("{\"\":", 17)), "x.json: 17 arrays and objects inside one another, limit 16");
  EXPECT_EQ(message(repeated("[],", 6), limits), "x.json: 6 arrays and objects, limit 5");
  EXPECT_EQ(message(repeated("1,", 6), limits), "x.json: 6 values, limit 5");
  EXPECT_EQ(message(repeated(":", 6), limits), "x.json: 6 keys, limit 5");
  EXPECT_EQ(message('"' + std::string(20, 'x') + '"', limits), "x.json: 22 bytes in one text, limit 10");
  EXPECT_EQ(message(std::string(20, '7'), limits), "x.json: 20 bytes in one number, limit 10");
  EXPECT_EQ(message("]"), "x.json: not JSON: byte 0 closes what was not opened");
}

TEST(JsonGuard, MillionsOfBracketsTakeNeitherStackNorMemory) {
  for (const char* part : {"[", "{\"a\":", "[[],", "\"", "\\", "{\"\\\"", ",", ":"}) {
    static_cast<void>(message(repeated(part, 10'000'000)));  // ends, whatever it says
  }
  EXPECT_NE(message(repeated("[", 30'000'000)), "");
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
