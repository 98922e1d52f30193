#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "clients/cli/terminal/options.h"

/// The places at which the command line expects servers.
namespace trammel::cli {

[[nodiscard]] bool is_of_this_host(const HostPort& place);

/// True if a trammel server on this host holds the port. Its name is in the abstract namespace.
[[nodiscard]] bool held_by_server(const std::string& host, std::uint16_t port);

/// Reports on the named servers that do not answer, one line each. `answering`: the number of
/// servers that answer. On other hosts nobody knows which servers these are, so one line reports
/// them together.
[[nodiscard]] std::vector<std::string> silent_servers(const ServiceOptions& service,
                                                      std::size_t answering);

}  // namespace trammel::cli
