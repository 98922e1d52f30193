#include "server/dds/port_lock.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <utility>

namespace trammel {

namespace {

/// A socket with this name in the abstract namespace: claimed atomically, freed by the kernel.
/// Below 0: the name is in use.
int named_socket(const std::string& text) {
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  const std::size_t length = std::min(text.size(), sizeof name.sun_path - 1);
  std::copy_n(text.begin(), length, name.sun_path + 1);
  const int lock = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const auto name_size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + length);
  if (lock >= 0 && bind(lock, reinterpret_cast<const sockaddr*>(&name), name_size) == 0)
    return lock;
  if (lock >= 0) close(lock);
  return -1;
}

}  // namespace

Result<PortLock> PortLock::take_name(std::uint32_t domain, const std::string& server) {
  const int lock = named_socket(fmt::format("trammel-name-{}-{}", domain, server));
  if (lock >= 0) return PortLock(lock);
  return failure(ErrorCode::kConflict,
                 "another trammel server of this host is called {} in domain {}", server, domain)
      .of("server")
      .with_text(server)
      .next("give this one a name of its own");
}

Result<PortLock> PortLock::take(const std::string& address, std::uint16_t port) {
  const int lock = named_socket(fmt::format("trammel-dds-{}-{}", address, port));
  PortLock result(lock);
  if (lock < 0) {
    return failure(ErrorCode::kConflict, "another trammel server uses port {} on {}", port, address)
        .of("port")
        .with_value(port)
        .next("give this one its own");
  }

  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(port);
  if (inet_pton(AF_INET, address.c_str(), &place.sin_addr) != 1) {
    return failure(ErrorCode::kUsage, "address `{}` is not an IPv4 address", address)
        .of("address")
        .with_text(address);
  }
  const int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool is_free =
      probe >= 0 && bind(probe, reinterpret_cast<const sockaddr*>(&place), sizeof place) == 0;
  const int why = errno;
  if (probe >= 0) close(probe);
  if (!is_free && why == EADDRNOTAVAIL) {
    return failure(ErrorCode::kUsage,
                   "address {} is not one of this host's, or its interface is down", address)
        .of("address")
        .with_text(address);
  }
  if (!is_free)
    return failure(ErrorCode::kConflict, "UDP port {} on {} is taken by another program", port,
                   address)
        .of("port")
        .with_value(port);
  return result;
}

PortLock::~PortLock() {
  if (socket_ >= 0) close(socket_);
}

PortLock::PortLock(PortLock&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}

}  // namespace trammel
