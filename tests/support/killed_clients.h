#pragma once

#include <cstddef>

#include "clients/session/session.h"

namespace trammel::test {

struct KillLoad {
  client::SessionOptions server;
  int kills = 100;
  int at_once = 6;  ///< clients that live at a time, each for 30 to 600 ms
  int idle = 20;    ///< clients that are connected all the time and ask nothing
  int honest = 2;   ///< clients that ask 20 times a second all the time
};

struct KillOutcome {
  int killed = 0;
  std::size_t calls = 0;      ///< of the honest clients
  std::size_t lost = 0;       ///< those of them without an answer
  double longest_call_s = 0;  ///< of the honest clients, including lost calls
};

/// Kills clients (-9) while they connect and call and others are connected. The clients are forked
/// from this process, which has no participant yet.
[[nodiscard]] KillOutcome kill_clients(const KillLoad& load);

}  // namespace trammel::test
