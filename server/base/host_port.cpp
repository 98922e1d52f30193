#include "server/base/host_port.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <memory>
#include <optional>

#include "server/base/plain_text.h"

namespace trammel {
namespace {

constexpr std::uint16_t kAnyPort = 9;  // any number serves: a route does not depend on it

std::string text_of(const in_addr& address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  return inet_ntop(AF_INET, &address, text.data(), text.size()) == nullptr
             ? std::string()
             : std::string(text.data());
}

std::optional<std::string> resolved(const std::string& host) {
  in_addr direct{};
  if (inet_pton(AF_INET, host.c_str(), &direct) == 1) return text_of(direct);
  addrinfo wanted{};
  wanted.ai_family = AF_INET;
  wanted.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), nullptr, &wanted, &found) != 0) return std::nullopt;
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> all(found, freeaddrinfo);
  sockaddr_in first{};
  std::memcpy(&first, found->ai_addr, sizeof first);
  return text_of(first.sin_addr);
}

std::optional<std::uint16_t> port_of(const std::string& text) {
  int port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc{} || end != text.data() + text.size() || port < 1024 || port > 65535)
    return std::nullopt;
  return static_cast<std::uint16_t>(port);
}

}  // namespace

Result<HostPort> parse_host_port(const std::string& text, std::uint16_t port) {
  const std::size_t colon = text.find(':');
  const std::optional<std::uint16_t> said =
      colon == std::string::npos ? port : port_of(text.substr(colon + 1));
  if (!said) {
    return failure(ErrorCode::kUsage, "'{}', expected host:port with a port from 1024 to 65535",
                   shown_short(text))
        .with_text(shown_short(text));
  }
  const std::string host = text.substr(0, colon);
  const auto address = host.empty() ? std::nullopt : resolved(host);
  if (!address) {
    return failure(ErrorCode::kUsage,
                   "'{}' is no IPv4 address, and no name that this host can look up",
                   shown_short(host))
        .with_text(shown_short(host));
  }
  return HostPort{*address, *said};
}

Result<std::vector<HostPort>> parse_hosts(const std::vector<std::string>& hosts,
                                          const std::vector<std::uint16_t>& ports) {
  std::vector<HostPort> places;
  for (const std::string& host : hosts) {
    const bool has_port = host.find(':') != std::string::npos;
    const std::size_t count = has_port ? 1 : ports.size();
    for (std::size_t i = 0; i < count; ++i) {
      auto place = parse_host_port(host, has_port ? 0 : ports[i]);
      if (!place) return tl::make_unexpected(std::move(place.error()));
      places.push_back(*std::move(place));
    }
  }
  return places;
}

std::string to_string(const HostPort& place) {
  return fmt::format("{}:{}", place.address, place.port);
}

std::vector<std::string> own_addresses() {
  std::vector<std::string> own;
  ifaddrs* first = nullptr;
  if (getifaddrs(&first) != 0) return own;
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> all(first, freeifaddrs);
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    if ((one->ifa_flags & IFF_RUNNING) == 0) continue;
    sockaddr_in place{};
    std::memcpy(&place, one->ifa_addr, sizeof place);
    own.push_back(text_of(place.sin_addr));
  }
  return own;
}

Result<std::string> own_address_towards(const std::string& address) {
  const std::vector<std::string> own = own_addresses();
  if (std::find(own.begin(), own.end(), address) != own.end()) return address;
  sockaddr_in there{};
  there.sin_family = AF_INET;
  there.sin_port = htons(kAnyPort);
  const bool is_address = inet_pton(AF_INET, address.c_str(), &there.sin_addr) == 1;
  const int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in here{};
  socklen_t size = sizeof here;
  // A datagram socket that is connected has its own address, and has sent nothing.
  const bool routed =
      is_address && probe >= 0 &&
      connect(probe, reinterpret_cast<const sockaddr*>(&there), sizeof there) == 0 &&
      getsockname(probe, reinterpret_cast<sockaddr*>(&here), &size) == 0;
  if (probe >= 0) close(probe);
  if (!routed)
    return failure(ErrorCode::kUnreachable, "no interface of this host leads to {}",
                   shown_short(address))
        .with_text(shown_short(address))
        .next("is the interface up? ip route");
  return text_of(here.sin_addr);
}

}  // namespace trammel
