#pragma once

#include "server/store/cell_rows.h"
#include "server/store/database/database.h"
#include "server/store/store.h"

/// Changes that happen once, for the transactions of batches, jobs and models.
namespace trammel {

/// The outcome recorded under the id, if any. kConflict: the id belongs to another request.
[[nodiscard]] Result<std::optional<ChangeOutcome>> find_change(Database& database,
                                                               const ChangeId& change_id);
/// Records the outcome of a change in the open transaction.
void record_change(Database& database, const ChangeId& change_id, const ChangeOutcome& outcome);

/// Refuses (kConflict) where another version of the cell is in force than the change expects.
[[nodiscard]] Status check_expected_version(Database& database, const std::string& cell,
                                            const ChangeId& change_id);

/// Locks the cell and runs `work`, which returns a Result<ChangeOutcome>. If this id was done
/// before, it returns the earlier outcome instead.
template <typename Work>
[[nodiscard]] Result<ChangeOutcome> once(Database& database, const std::string& cell,
                                         const ChangeId& change_id, const Work& work) {
  lock_cell(database, cell);
  if (!change_id.id.empty()) {
    auto made = find_change(database, change_id);
    if (!made) return tl::make_unexpected(made.error());
    if (*made) return **made;
  }
  if (auto expected = check_expected_version(database, cell, change_id); !expected)
    return tl::make_unexpected(expected.error());
  Result<ChangeOutcome> outcome = work();
  if (outcome && !change_id.id.empty()) record_change(database, change_id, *outcome);
  return outcome;
}

}  // namespace trammel
