#include "tests/support/own_ports.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>

namespace trammel::test {
namespace {

constexpr int kBlocks = 1500;
constexpr int kFirstPort = 20000;
constexpr int kDomains = 48;  // the ports that DDS derives from these domains end below kFirstPort

/// True if this process now has the number of that kind. Others see it by an abstract socket, which
/// the kernel releases with the process. tests/python/test_trammel.py uses the same names.
bool reserve(const char* kind, int number) {
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  const std::string text = fmt::format("trammel-test-{}-{}", kind, number);
  std::copy(text.begin(), text.end(), name.sun_path + 1);
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + text.size());
  const int held = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (::bind(held, reinterpret_cast<const sockaddr*>(&name), size) == 0)
    return true;  // kept open for good
  ::close(held);
  return false;
}

bool is_free(int port, int type) {
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_port = htons(static_cast<std::uint16_t>(port));
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int tried = ::socket(AF_INET, type | SOCK_CLOEXEC, 0);
  const int yes = 1;  // a connection that has just ended is no hindrance
  if (type == SOCK_STREAM) ::setsockopt(tried, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  const bool is = ::bind(tried, reinterpret_cast<const sockaddr*>(&at), sizeof(at)) == 0;
  ::close(tried);
  return is;
}

bool are_free(int first) {
  for (int port = first; port < first + kOwnPorts; ++port) {
    if (!is_free(port, SOCK_DGRAM) || !is_free(port, SOCK_STREAM)) return false;
  }
  return true;
}

/// Starts at the process's id, so that ports come back late.
int own_block() {
  for (int tried = 0; tried < kBlocks; ++tried) {
    const int block = (::getpid() + tried) % kBlocks;
    if (reserve("ports", block) && are_free(kFirstPort + kOwnPorts * block)) return block;
  }
  throw std::runtime_error("no ports are left for this test");
}

int block() {
  static const int mine = own_block();
  return mine;
}

/// In one domain, the port of a client that has left may become the next client's. A server that
/// still announces itself to the former client then answers the next one. If more tests run at once
/// than there are domains, two share one.
int free_domain() {
  for (int tried = 0; tried < kDomains; ++tried) {
    const int domain = 1 + (block() + tried) % kDomains;
    if (reserve("domain", domain)) return domain;
  }
  return 1 + block() % kDomains;
}

}  // namespace

std::uint16_t own_ports() { return static_cast<std::uint16_t>(kFirstPort + kOwnPorts * block()); }
std::uint32_t own_domain() {
  static const int mine = free_domain();
  return static_cast<std::uint32_t>(mine);
}

}  // namespace trammel::test
