#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <vector>

#include "tests/support/daemon.h"

namespace trammel {
namespace {

/// Every port of the first 115 participants of a domain on this host, as other programs hold them.
class HeldPorts {
 public:
  explicit HeldPorts(std::uint32_t domain) {
    const std::uint32_t first = 7400 + 250 * domain + 10;
    for (std::uint32_t port = first; port < first + 2 * 115; ++port)
      hold(static_cast<std::uint16_t>(port));
  }
  HeldPorts(const HeldPorts&) = delete;
  HeldPorts& operator=(const HeldPorts&) = delete;
  ~HeldPorts() {
    for (const int socket : sockets_) ::close(socket);
  }

 private:
  void hold(std::uint16_t port) {
    sockets_.push_back(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_in place{};
    place.sin_family = AF_INET;
    place.sin_port = htons(port);
    place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    // One that is taken already is as good.
    (void)::bind(sockets_.back(), reinterpret_cast<const sockaddr*>(&place), sizeof place);
  }

  std::vector<int> sockets_;
};

// The library looks for free ports as often as it is told, and then makes a participant that hears
// nothing.
TEST(ManyClients, TheHundredAndSixteenthOfAHostIsAnsweredAsTheFirst) {
  test::Daemon daemon;
  daemon.start();
  const HeldPorts others(daemon.session_options().domain);
  const auto client = client::Session::open(daemon.session_options());
  ASSERT_TRUE(client) << sentence(client.error());
  const auto models = (*client)->models("cell-7");
  EXPECT_TRUE(models) << sentence(models.error());
}

}  // namespace
}  // namespace trammel
