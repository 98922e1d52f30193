// Kills clients of a running daemon: killed_clients PORT DOMAIN KILLS [IDLE]
#include <cstdio>
#include <cstdlib>

#include "tests/support/killed_clients.h"

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: %s PORT DOMAIN KILLS [IDLE]\n", argv[0]);
    return 2;
  }
  trammel::test::KillLoad load;
  load.server.server_ports = {static_cast<std::uint16_t>(std::atoi(argv[1]))};
  load.server.domain = static_cast<std::uint32_t>(std::atoi(argv[2]));
  load.server.timeout = std::chrono::seconds(30);
  load.kills = std::atoi(argv[3]);
  if (argc > 4) load.idle = std::atoi(argv[4]);
  const trammel::test::KillOutcome outcome = trammel::test::kill_clients(load);
  std::printf("killed %d; honest clients: %zu calls, %zu lost, longest %.2f s\n", outcome.killed,
              outcome.calls, outcome.lost, outcome.longest_call_s);
  return outcome.lost == 0 && outcome.killed == load.kills ? 0 : 1;
}
