#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <chrono>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "server/base/mutex.h"
#include "server/base/result.h"
#include "server/store/open_database.h"
#include "server/store/served_copies.h"
#include "server/store/statements.h"
#include "server/store/store_state.h"
#include "server/store/writer_lock.h"

namespace trammel {

/// One connection behind one lock. Where the file cannot be written it is read, or not even that; it is tried again by
/// whoever wants to write, once a second at most.
struct StoreConnection {
  StoreConnection(std::string file, WriterLock writer, OpenedDatabase opened, std::unique_ptr<ServedCopies> kept)
      : path(std::move(file)), lock(std::move(writer)), copies(std::move(kept)), database(std::move(opened.file)) {
    if (opened.why_not_written) note_trouble(*opened.why_not_written, database == nullptr);
    must_be_opened_anew_ = opened.why_not_written.has_value();
  }

  /// Runs `work(database)` with the lock held, for reading. An exception of SQLite becomes an error.
  template <typename Work>
  auto exclusively(const Work& work) -> decltype(work(std::declval<SQLite::Database&>())) {
    const MutexLock guard(mutex);
    if (!database) return tl::make_unexpected(*state().why_not_written);
    try {
      return work(*database);
    } catch (const SQLite::Exception& error) {
      return failure_of(error, path).as(ErrorCode::kInternal);
    } catch (const std::exception& error) {
      return failure(ErrorCode::kInternal, "{}", error.what()).in(path);
    }
  }

  /// The same in one transaction, committed only if `work` succeeds.
  template <typename Work>
  auto in_transaction(const Work& work) -> decltype(work(std::declval<SQLite::Database&>())) {
    const MutexLock guard(mutex);
    if (auto open = open_anew(); !open) return tl::make_unexpected(open.error());
    try {
      SQLite::Transaction transaction(*database, SQLite::TransactionBehavior::IMMEDIATE);
      const int changes = database->getTotalChanges();
      auto result = work(*database);
      if (result) transaction.commit();
      if (result && database->getTotalChanges() != changes) note_written();
      return result;
    } catch (const SQLite::Exception& error) {
      Failure said = failure_of(error, path);
      if (is_of_the_disk(error)) note_trouble(said.value(), false);
      return said;
    } catch (const std::exception& error) {
      return failure(ErrorCode::kInternal, "{}", error.what()).in(path);
    }
  }

  [[nodiscard]] StoreState state() const;
  /// Tells those who wait that the state has changed.
  void note_trouble(const Error& why, bool unreadable);
  void note_written();
  /// Something that was found damaged; said once.
  void note_damage(const std::string& what);

  const std::string path;
  const WriterLock lock;
  const std::unique_ptr<ServedCopies> copies;
  Mutex mutex;
  std::unique_ptr<SQLite::Database> database TRAMMEL_GUARDED_BY(mutex);  // null: cannot be read
  mutable Mutex state_mutex;                                             // taken last, and for moments only
  Condition state_changed;
  StoreState state_now TRAMMEL_GUARDED_BY(state_mutex);

 private:
  /// Opens a file again that could not be written when it was opened.
  [[nodiscard]] Status open_anew() TRAMMEL_REQUIRES(mutex);

  bool must_be_opened_anew_ TRAMMEL_GUARDED_BY(mutex) = false;
  std::chrono::steady_clock::time_point tried_last_ TRAMMEL_GUARDED_BY(mutex) = {};
};

}  // namespace trammel
