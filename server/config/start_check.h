#pragma once

#include <string>
#include <vector>

#include "server/config/server_config.h"

namespace trammel {

/// The result of a start on this host, found without starting: nothing is changed or created.
struct StartCheck {
  std::vector<Error> problems;     ///< each would make a start fail; with file, key and remedy
  std::vector<std::string> notes;  ///< good to know
  std::vector<std::string> dark;   ///< cells that would lose their present model, and the reason
};

/// The store to examine: the one in the server file, or an unused copy of it.
enum class StoreToCheck { kOwn, kCopy };

/// Checks the store, the log file, the address and the port in the server file at `path`, as far as
/// they could be read. The errors of reading come first. If this server seems to run already
/// (servers hold both its port and its store), the result is a note. With a copy of the store each
/// of these is a note, since the service is meant to run meanwhile. Also reports the models with
/// which this program would serve the cells from the store as it is.
[[nodiscard]] StartCheck check_start(const ServerReading& server, const std::string& path,
                                     StoreToCheck store = StoreToCheck::kOwn);

}  // namespace trammel
