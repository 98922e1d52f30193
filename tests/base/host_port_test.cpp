#include "server/base/host_port.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace trammel {
namespace {

TEST(HostPort, IsANameOrAnAddressWithItsPortOrTheUsualOne) {
  EXPECT_EQ(parse_host_port("10.1.0.3:17502", 17500).value(), (HostPort{"10.1.0.3", 17502}));
  EXPECT_EQ(parse_host_port("10.1.0.3", 17500).value(), (HostPort{"10.1.0.3", 17500}));
  EXPECT_EQ(parse_host_port("localhost:2000", 17500).value(), (HostPort{"127.0.0.1", 2000}));
}

TEST(HostPort, RefusesWhatIsNeitherAndAPortOutOfRange) {
  for (const char* wrong : {"", ":17500", "127.0.0.1:", "127.0.0.1:80", "127.0.0.1:70000",
                            "127.0.0.1:17500x", "127.0.0.1:1:2"}) {
    const auto place = parse_host_port(wrong, 17500);
    ASSERT_FALSE(place) << wrong;
    EXPECT_EQ(place.error().code, ErrorCode::kUsage) << wrong;
  }
}

TEST(HostPort, AHostReachesItsOwnAddressByThatAddress) {
  const auto own = own_addresses();
  EXPECT_NE(std::find(own.begin(), own.end(), "127.0.0.1"), own.end());
  for (const std::string& address : own) EXPECT_EQ(own_address_towards(address).value(), address);
  EXPECT_EQ(own_address_towards("127.0.0.2").value(), "127.0.0.1");
  EXPECT_FALSE(own_address_towards("nowhere"));
}

}  // namespace
}  // namespace trammel
