#pragma once

#include <string>
#include <vector>

#include "server/config/server_config.h"

namespace trammel {

/// What a start would find on this host, seen without starting: nothing is changed, created or left.
struct StartCheck {
  std::vector<Error> problems;     ///< a start would fail; with file, key and what to do
  std::vector<std::string> notes;  ///< good to know
};

/// Looks for the store, the log file, the address and the port that the server file at `path` names, as far as they
/// could be read, after what was wrong with reading it. Where this very
/// server seems to run already (its port and its store are both held by servers), that is a note.
[[nodiscard]] StartCheck check_start(const ServerReading& server, const std::string& path);

}  // namespace trammel
