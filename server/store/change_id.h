#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace trammel {

/// A change that happens once, however often it is asked for: also when the answer to it was lost
/// in a crash.
struct ChangeId {
  std::string id;  ///< unique for ever: the client and the number of its request; empty: nothing is
                   ///< remembered
  std::string
      asked;  ///< what is asked for, in any words; the same id for anything else is a conflict
  std::string who = {};     ///< for the audit trail; empty: the service itself
  std::string reason = {};  ///< likewise, in any words
  std::optional<int> expected_version =
      {};  ///< that is in force, 0: none; with another one nothing changes (kConflict)
};

/// The outcome of such a change.
struct ChangeOutcome {
  int version = 0;           ///< of the model that was put in force or stored; 0: of none
  std::int64_t job = 0;      ///< that was queued; 0: none
  std::int64_t made_at = 0;  ///< Unix time, s
};

}  // namespace trammel
