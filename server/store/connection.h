#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <chrono>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "server/base/mutex.h"
#include "server/base/result.h"
#include "server/store/clock_watch.h"
#include "server/store/open_database.h"
#include "server/store/schema.h"
#include "server/store/served_copies.h"
#include "server/store/statements.h"
#include "server/store/store_file.h"
#include "server/store/store_state.h"
#include "server/store/writer_lock.h"

namespace trammel {

/// One connection behind one lock. Where the file cannot be written it is read, or not even that; it is tried again by
/// whoever wants to write, once a second at most. Nothing is acknowledged but what is in the file that the path leads
/// to: a file that was removed, replaced or written by another program is read at most, until it is back as it was.
struct StoreConnection {
  StoreConnection(WriterLock writer, StoreFile held, std::string name, OpenedDatabase opened,
                  std::unique_ptr<ServedCopies> kept);
  ~StoreConnection();

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
    if (auto sure = be_sure_of_file(); !sure) return tl::make_unexpected(sure.error());
    bool changed = false;
    auto result = transacted(work, &changed);
    file.remember();
    if (!result || !changed) return result;
    if (auto there = check_in_place(); !there) return tl::make_unexpected(there.error());
    note_written();
    return result;
  }

  /// Whether the file is as this process left it, and can be written as far as is known.
  [[nodiscard]] bool is_in_order();
  [[nodiscard]] StoreState state() const;
  /// Tells those who wait that the state has changed.
  void note_trouble(const Error& why, bool unreadable);
  void note_written();
  /// Something that was found damaged; said once.
  void note_damage(const std::string& what);
  /// By how much the host's clock was set since this was called last; empty: it was not.
  [[nodiscard]] std::optional<std::chrono::seconds> note_clock();

  const std::string path;
  const WriterLock lock;
  const std::unique_ptr<ServedCopies> copies;
  Mutex mutex;
  StoreFile file TRAMMEL_GUARDED_BY(mutex);                              // let go of after the database is closed
  std::unique_ptr<SQLite::Database> database TRAMMEL_GUARDED_BY(mutex);  // null: cannot be read
  mutable Mutex state_mutex;                                             // taken last, and for moments only
  Condition state_changed;
  StoreState state_now TRAMMEL_GUARDED_BY(state_mutex);
  ClockWatch clock TRAMMEL_GUARDED_BY(state_mutex){ClockWatch::now()};

 private:
  template <typename Work>
  std::invoke_result_t<const Work&, SQLite::Database&> transacted(const Work& work, bool* changed)
      TRAMMEL_REQUIRES(mutex) {
    try {
      SQLite::Transaction transaction(*database, SQLite::TransactionBehavior::IMMEDIATE);
      const int changes = database->getTotalChanges();
      auto result = work(*database);
      if (!result) return result;
      *changed = database->getTotalChanges() != changes;
      auto mark = *changed ? mark_of(*database) : mark_;
      transaction.commit();
      mark_ = std::move(mark);
      return result;
    } catch (const SQLite::Exception& error) {
      Failure said = failure_of(error, path);
      if (is_of_the_disk(error)) note_trouble(said.value(), false);
      return said;
    } catch (const std::exception& error) {
      return failure(ErrorCode::kInternal, "{}", error.what()).in(path);
    }
  }

  /// Opens a file again that could not be written when it was opened, or that is not as it was left.
  [[nodiscard]] Status be_sure_of_file() TRAMMEL_REQUIRES(mutex);
  [[nodiscard]] Status open_anew() TRAMMEL_REQUIRES(mutex);
  [[nodiscard]] Status opened_anew() TRAMMEL_REQUIRES(mutex);
  /// Whether what is at the path now is the store as it was left. Closes the database if that was written by others.
  [[nodiscard]] Status check_as_left() TRAMMEL_REQUIRES(mutex);
  /// Whether what was just committed is in the file that the path leads to.
  [[nodiscard]] Status check_in_place() TRAMMEL_REQUIRES(mutex);
  /// The journal of a file that is no longer at the path would be taken for that of the next one there.
  void leave_no_journal() TRAMMEL_REQUIRES(mutex);
  void note_opened() TRAMMEL_REQUIRES(mutex);

  bool must_be_opened_anew_ TRAMMEL_GUARDED_BY(mutex) = false;
  bool was_written_ TRAMMEL_GUARDED_BY(mutex) = false;            // by this process: no other state is taken again
  std::optional<StoreMark> mark_ TRAMMEL_GUARDED_BY(mutex) = {};  // of that state; empty: it could not be read
  std::chrono::steady_clock::time_point tried_last_ TRAMMEL_GUARDED_BY(mutex) = {};
};

}  // namespace trammel
