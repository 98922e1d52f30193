#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace trammel {

/// The id of a change. The change happens once, however often it is requested, even if a crash lost
/// the first answer.
struct ChangeId {
  std::string id;  ///< unique for ever: the client and the number of its request; empty: nothing is
                   ///< remembered
  std::string asked;  ///< the request, in any words; the same id for another request is a conflict
  std::string who = {};     ///< for the audit trail; empty: the service itself
  std::string reason = {};  ///< likewise, in any words
  std::optional<int> expected_version =
      {};  ///< the version that must be in force, 0: none; otherwise nothing changes (kConflict)
};

/// The outcome of such a change.
struct ChangeOutcome {
  int version = 0;           ///< of the model that was put in force or stored; 0: none
  std::int64_t job = 0;      ///< the queued job; 0: none
  std::int64_t made_at = 0;  ///< Unix time, s
};

}  // namespace trammel
