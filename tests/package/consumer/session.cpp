#include "clients/session/session.h"

#include <cstdio>
#include <cstdlib>

// Asks a daemon which cells it serves: session PORT DOMAIN
int main(int, char** arguments) {
  trammel::client::SessionOptions options;
  options.server_ports = {static_cast<std::uint16_t>(std::atoi(arguments[1]))};
  options.domain = static_cast<std::uint32_t>(std::atoi(arguments[2]));
  options.timeout = std::chrono::seconds(60);
  const auto session = trammel::client::Session::open(options);
  const auto servers = session ? (*session)->servers() : tl::make_unexpected(session.error());
  if (!servers) return std::puts(servers.error().message.c_str()), 1;
  for (const auto& cell : servers->front().cells) std::puts(cell.c_str());
}
