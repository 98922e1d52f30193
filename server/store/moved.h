#pragma once

#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

/// A store that was moved elsewhere is not served and takes no changes: the last row of its trail
/// says so.
namespace trammel {

inline constexpr const char* kMovedRow = "moved";      // the kind of that row
inline constexpr const char* kReopenedRow = "reopen";  // the one row that may follow it
inline constexpr const char* kMovedField = "moved";    // the field that the error of such a store
                                                       // names

/// Refuses (kRefused) a moved store, with the place and time of the move. Does not check the trail
/// for damage.
[[nodiscard]] Status check_not_moved(Database& database, const std::string& place);

/// Adds the store's new place to the trail, at the end of the open transaction.
void record_move(Database& database, const std::string& to);

}  // namespace trammel
