#include "server/dds/port_lock.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/dds/backend.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

constexpr const char* kHere = "127.0.0.1";

TEST(PortLock, ASecondServerOnThePortIsRefused) {
  const std::uint16_t port = test::test_dds_options().port;
  {
    const auto first = PortLock::take(kHere, port);
    ASSERT_TRUE(first) << first.error().message;
    const auto second = PortLock::take(kHere, port);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, ErrorCode::kConflict);
    EXPECT_EQ(refusal_of(second), Refusal("", {}, "port").of(ErrorCode::kConflict).value(port));
    EXPECT_TRUE(PortLock::take(kHere, static_cast<std::uint16_t>(port + 1)));
  }
  EXPECT_TRUE(PortLock::take(kHere, port));
}

TEST(PortLock, ASecondServerOfANameIsRefusedInTheSameDomainOnly) {
  const std::string name = fmt::format("server-{}", ::getpid());
  {
    const auto first = PortLock::take_name(1, name);
    ASSERT_TRUE(first) << first.error().message;
    const auto second = PortLock::take_name(1, name);
    ASSERT_FALSE(second);
    EXPECT_EQ(refusal_of(second), Refusal("", {}, "server").of(ErrorCode::kConflict).text(name));
    EXPECT_TRUE(PortLock::take_name(2, name));
    EXPECT_TRUE(PortLock::take_name(1, name + "-b"));
  }
  EXPECT_TRUE(PortLock::take_name(1, name));
}

TEST(PortLock, APortOfAnotherProgramIsRefused) {
  const std::uint16_t port = test::test_dds_options().port;
  const int other = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(port);
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(::bind(other, reinterpret_cast<const sockaddr*>(&place), sizeof place), 0);
  const auto lock = PortLock::take(kHere, port);
  ::close(other);
  ASSERT_FALSE(lock);
  EXPECT_EQ(refusal_of(lock), Refusal("", {}, "port").of(ErrorCode::kConflict).value(port));
}

}  // namespace
}  // namespace trammel
