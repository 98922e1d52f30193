#pragma once

#include <memory>
#include <string>
#include <utility>

#include "server/base/result.h"
#include "server/store/database/database.h"

namespace trammel {

/// Opens a store for reading, even while services use it: a file, or a database by its URL. Leaves
/// no traces. Refuses a place that is not a store. Throws DatabaseError.
[[nodiscard]] Result<std::unique_ptr<Database>> open_to_read(const std::string& place);
/// Opens a store for changes that services do not make: a file whose writer lock the caller holds,
/// or a database by its URL. Refuses and throws as open_to_read().
[[nodiscard]] Result<std::unique_ptr<Database>> open_to_write(const std::string& place);
/// The failure to read a store, with the session that holds it locked. `place` may contain a
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
