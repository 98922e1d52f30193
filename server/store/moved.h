#pragma once

#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

/// A store that was moved elsewhere is served by nobody, and takes no change: the last row of its
/// trail says so.
namespace trammel {

inline constexpr const char* kMovedRow = "moved";      // what that row is
inline constexpr const char* kReopenedRow = "reopen";  // the one row that may follow it
inline constexpr const char* kMovedField = "moved";    // what the error of such a store is of

/// Refuses (kRefused) a store that was moved, and says where to and when. A damaged trail is not
/// looked at here.
[[nodiscard]] Status check_not_moved(Database& database, const std::string& place);

/// Says in the trail, at the end of the open transaction, where the store goes on.
void record_move(Database& database, const std::string& to);

}  // namespace trammel
