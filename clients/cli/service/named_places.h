#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "clients/cli/terminal/options.h"

/// The places where a command line says that servers are.
namespace trammel::cli {

[[nodiscard]] bool is_of_this_host(const HostPort& place);

/// True if a trammel server of this host holds the port: its name in the abstract namespace.
[[nodiscard]] bool held_by_server(const std::string& host, std::uint16_t port);

/// What to say of the servers that were named and do not answer, a line each; `answering`: how many
/// do. On other hosts nobody knows which those are: they are told together.
[[nodiscard]] std::vector<std::string> silent_servers(const ServiceOptions& service,
                                                      std::size_t answering);

}  // namespace trammel::cli
