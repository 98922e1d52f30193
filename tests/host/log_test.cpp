#include "server/host/log.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "server/host/log_limit.h"

namespace trammel {
namespace {

using std::chrono::seconds;

TEST(Log, AFactAsJsonIsOneObjectInOneLineWhateverItsTextsHold) {
  const std::string hostile = "a\"},\n{\"level\":\"error\"\x1b[31m\xff </script>";
  const std::string members =
      log_members("request_refused", hostile, {{"cell", hostile}, {"who", ""}, {"trace", "t-1"}});
  EXPECT_EQ(members.find('\n'), std::string::npos);
  EXPECT_EQ(members.find('\x1b'), std::string::npos);
  const auto json = nlohmann::json::parse("{" + members + "}");
  EXPECT_EQ(json["event"], "request_refused");
  EXPECT_EQ(json["trace"], "t-1");
  EXPECT_FALSE(json.contains("who")) << "what is not known is left out";
  EXPECT_EQ(json.size(), 4u) << "no text makes members of its own: " << members;
}

TEST(LogLimit, OfOneKindAFewLinesAMinuteGoAndTheNextOneSaysHowManyWereLeftOut) {
  LogLimit limit;
  const LogLimit::Time began{};
  for (int i = 0; i < LogLimit::kMost; ++i) EXPECT_TRUE(limit.look("a", began).goes);
  for (int i = 0; i < 500; ++i) EXPECT_FALSE(limit.look("a", began + seconds(1)).goes);
  EXPECT_TRUE(limit.look("b", began + seconds(1)).goes) << "each kind has its own limit";
  const auto next = limit.look("a", began + LogLimit::kWithin);
  EXPECT_TRUE(next.goes);
  EXPECT_EQ(next.left_out_before, 500u);
  EXPECT_EQ(limit.look("a", began + LogLimit::kWithin).left_out_before, 0u) << "said once";
}

}  // namespace
}  // namespace trammel
