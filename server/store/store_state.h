#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The place of a store, for people who look at servers.
struct RecordState {
  std::string kind;   ///< `sqlite`, `postgresql`
  std::string place;  ///< a file, or a URL without password and options
  bool reachable = true;
  std::optional<std::int64_t> away_since = {};  ///< Unix time, s
  std::string survives;  ///< the failures that an acknowledged change survives; empty: not known
                         ///< now
  std::string worry;     ///< the defect in that, and its repair; empty: none
  std::optional<bool> trail_is_safe =
      {};  ///< the servers' role can neither change nor delete it; empty: not known
};

/// The state of a store, as far as its disk lets it work.
struct StoreState {
  std::optional<Error> why_not_written;  ///< set: every change is refused with this error
  bool readable = true;  ///< false: only the copies of the models that were in force are there
  std::int64_t since =
      0;  ///< Unix time, s, of the last change of either; 0: none since it was opened
  std::uint64_t failed_writes = 0;
  std::string clock;  ///< one sentence: the host's clock was changed, so dates may be wrong; empty:
                      ///< it was not
  std::vector<std::string> damages;  ///< the damages found since it was opened, the first hundred
};

}  // namespace trammel
