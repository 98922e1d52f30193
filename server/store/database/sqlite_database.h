#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>

#include "server/store/database/database.h"

namespace trammel {

/// An SQLite file.
class SqliteDatabase final : public Database {
 public:
  /// `flags`: those of SQLite. `busy_ms`: how long it waits while another program holds the file.
  SqliteDatabase(const std::string& path, int flags, int busy_ms);

  using Database::change;
  using Database::run;
  void execute(const std::string& statements) override;
  [[nodiscard]] Rows run(const char* sql, Values values) override;
  int change(const char* sql, Values values) override;
  [[nodiscard]] bool has_table(const std::string& name) override;
  [[nodiscard]] bool is_shared() const override { return false; }

  /// Rows changed since it was opened.
  [[nodiscard]] int total_changes() const { return file_.getTotalChanges(); }
  /// For operations that only SQLite has: copies page by page.
  [[nodiscard]] SQLite::Database& file() { return file_; }

 private:
  void begin(bool writes) override;
  void commit() override;
  void roll_back() noexcept override;
  [[nodiscard]] SQLite::Statement bound(const char* sql, Values values);

  SQLite::Database file_;
};

/// Translates an error of SQLite for callers that know no SQLite.
[[nodiscard]] DatabaseError error_of(const SQLite::Exception& error);

/// Runs `work`; an exception of SQLite becomes a DatabaseError.
template <typename Work>
auto with_our_errors(const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const SQLite::Exception& error) {
    throw error_of(error);
  }
}

}  // namespace trammel
