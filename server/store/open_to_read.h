#pragma once

#include <memory>
#include <string>
#include <utility>

#include "server/base/result.h"
#include "server/store/database/database.h"

namespace trammel {

/// A store that is only looked at, also while services use it: a file, or a database by its URL.
/// Leaves nothing behind. Refuses what is no store. Throws DatabaseError.
[[nodiscard]] Result<std::unique_ptr<Database>> open_to_read(const std::string& place);
/// A store to change in what the services know nothing of: a file, of which the caller holds the
/// lock of who writes it, or a database by its URL. Refuses and throws as open_to_read().
[[nodiscard]] Result<std::unique_ptr<Database>> open_to_write(const std::string& place);
/// The failure of a store that is looked at, with whoever holds it locked. `place` may hold a
/// password.
[[nodiscard]] Failure failure_at(const DatabaseError& error, const std::string& place);

/// Runs `work(database)` on the store at `place`, opened by one of the two above.
template <typename Open, typename Work>
auto work_at(const std::string& place, const Open& open, const Work& work)
    -> decltype(work(std::declval<Database&>())) {
  try {
    const auto database = open(place);
    return database ? work(**database) : tl::make_unexpected(database.error());
  } catch (const DatabaseError& error) {
    return failure_at(error, place);
  }
}

/// Runs `work(database)` on one moment of the store at `place`.
template <typename Work>
auto look_into(const std::string& place, const Work& work) {
  return work_at(place, open_to_read, [&](Database& database) {
    const Transaction moment(database, Transaction::For::kReading);
    return work(database);
  });
}

}  // namespace trammel
