#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "server/base/result.h"

/// Where a service is reached.
namespace trammel {

struct HostPort {
  std::string address;  ///< IPv4
  std::uint16_t port = 0;
  bool operator==(const HostPort&) const = default;
};

inline constexpr std::uint16_t kDiscoveryPort =
    11811;  ///< of a discovery server, where none is said
inline constexpr std::size_t kMostDiscoveryServers = 8;

/// From `host` or `host:port`, the host a name or an IPv4 address: a name becomes its first
/// address. `port`: where none is said. kUsage: it is neither, or nobody knows the name.
[[nodiscard]] Result<HostPort> parse_host_port(const std::string& text, std::uint16_t port);

/// Several hosts at once; one without a port is at each of `ports`.
[[nodiscard]] Result<std::vector<HostPort>> parse_hosts(const std::vector<std::string>& hosts,
                                                        const std::vector<std::uint16_t>& ports);

[[nodiscard]] std::string to_string(const HostPort& place);

/// The IPv4 addresses of this host's interfaces that are up and have a link now.
[[nodiscard]] std::vector<std::string> own_addresses();
/// The IPv4 address of this host by which it reaches `address`, as the routes are now. Sends
/// nothing. kUnreachable: there is no route.
[[nodiscard]] Result<std::string> own_address_towards(const std::string& address);

}  // namespace trammel
