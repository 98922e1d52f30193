#pragma once

#include <string>
#include <vector>

#include "server/config/server_config.h"

namespace trammel {

/// The outcome that a start would have on this host. Found without starting: nothing is changed or
/// created.
struct StartCheck {
  std::vector<Error> problems;     ///< a start would fail; with file, key and what to do
  std::vector<std::string> notes;  ///< good to know
  std::vector<std::string>
      dark;  ///< cells that would lose the model that they are served with, and why
};

/// Whose store is looked at: the one that the server file names, or a copy of it, to which nobody
/// writes.
enum class StoreToCheck { kOwn, kCopy };

/// Checks the store, the log file, the address and the port that the server file at `path` names,
/// if they could be read. The errors of reading come first. If this server seems to run already
/// (its port and its store are both held by servers), that is a note. Beside a copy of the store
/// each of these is a note: the service is meant to run meanwhile. Looks also at what the cells
/// would be served with by this program, in the store as it is.
[[nodiscard]] StartCheck check_start(const ServerReading& server, const std::string& path,
                                     StoreToCheck store = StoreToCheck::kOwn);

}  // namespace trammel
