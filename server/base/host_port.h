#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "server/base/result.h"

/// The address of a service.
namespace trammel {

struct HostPort {
  std::string address;  ///< IPv4
  std::uint16_t port = 0;
  bool operator==(const HostPort&) const = default;
};

inline constexpr std::uint16_t kDiscoveryPort =
    11811;  ///< of a discovery server, if none is stated
inline constexpr std::size_t kMostDiscoveryServers = 8;

/// Parses `host` or `host:port`. The host is a name or an IPv4 address; a name becomes its first
/// address. `port` is used where the text gives none. kUsage: the text has neither form, or the
/// name does not resolve.
[[nodiscard]] Result<HostPort> parse_host_port(const std::string& text, std::uint16_t port);

/// Several hosts at once; one without a port is at each of `ports`.
[[nodiscard]] Result<std::vector<HostPort>> parse_hosts(const std::vector<std::string>& hosts,
                                                        const std::vector<std::uint16_t>& ports);

[[nodiscard]] std::string to_string(const HostPort& place);

/// The IPv4 addresses of this host's interfaces that are up and have a link now.
[[nodiscard]] std::vector<std::string> own_addresses();
/// The IPv4 address of this host from which it now routes to `address`. Sends nothing.
/// kUnreachable: there is no route.
[[nodiscard]] Result<std::string> own_address_towards(const std::string& address);

}  // namespace trammel
