#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "server/store/connection.h"
#include "server/store/open_database.h"
#include "server/store/schema.h"
#include "server/store/store_file.h"
#include "server/store/writer_lock.h"

namespace trammel {

/// An SQLite file: one connection behind one lock. If the file cannot be written, it is read if
/// possible. Each call that wants to write tries again, at most once a second. A change is
/// acknowledged only if it is in the file at the path. A file that was removed, replaced or written
/// by another program is at most read until it is back in its former state.
class FileConnection final : public StoreConnection {
 public:
  /// Refuses the same as Store::open().
  [[nodiscard]] static Result<std::unique_ptr<StoreConnection>> open(const std::string& path);
  FileConnection(WriterLock writer, StoreFile held, std::string name, OpenedDatabase opened,
                 std::unique_ptr<ServedCopies> kept);
  ~FileConnection() override;

  [[nodiscard]] bool is_shared() const override { return false; }
  [[nodiscard]] Status try_again() override;
  void wait_for_change(const std::stop_token& stop,
                       std::chrono::milliseconds limit) override;  // there is no other

 private:
  [[nodiscard]] Status read(const Job& job) override;
  [[nodiscard]] Status write(const Job& job) override;
  [[nodiscard]] Status transacted(const Job& job, bool* changed) TRAMMEL_REQUIRES(mutex_);
  /// True if the file is as this process left it, and no write has failed.
  [[nodiscard]] bool is_in_order();
  /// Reopens a file that could not be written when it was opened, or that has changed since.
  [[nodiscard]] Status be_sure_of_file() TRAMMEL_REQUIRES(mutex_);
  [[nodiscard]] Status open_anew() TRAMMEL_REQUIRES(mutex_);
  [[nodiscard]] Status opened_anew() TRAMMEL_REQUIRES(mutex_);
  /// Checks that the file at the path is the store in its last known state. Closes the database if
  /// others wrote the file.
  [[nodiscard]] Status check_as_left() TRAMMEL_REQUIRES(mutex_);
  /// Checks that the last commit is in the file at the path.
  [[nodiscard]] Status check_in_place() TRAMMEL_REQUIRES(mutex_);
  /// Removes the journal of a file that is no longer at the path. The next file there would take it
  /// for its own.
  void leave_no_journal() TRAMMEL_REQUIRES(mutex_);
  void note_opened() TRAMMEL_REQUIRES(mutex_);

  const WriterLock lock_;
  Mutex mutex_;
  StoreFile file_ TRAMMEL_GUARDED_BY(mutex_);  // let go of after the database is closed
  std::unique_ptr<SqliteDatabase> database_ TRAMMEL_GUARDED_BY(mutex_);  // null: cannot be read
  bool must_be_opened_anew_ TRAMMEL_GUARDED_BY(mutex_) = false;
  bool was_written_ TRAMMEL_GUARDED_BY(mutex_) =
      false;  // by this process: no other state is accepted later
  std::optional<StoreMark> mark_
      TRAMMEL_GUARDED_BY(mutex_) = {};  // of that state; empty: it could not be read
  std::chrono::steady_clock::time_point tried_last_ TRAMMEL_GUARDED_BY(mutex_) = {};
};

}  // namespace trammel
