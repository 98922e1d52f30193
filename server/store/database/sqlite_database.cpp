#include "server/store/database/sqlite_database.h"

#include <sqlite3.h>

namespace trammel {
namespace {

/// The disk is full, read-only or broken, or another program holds the file locked.
bool is_of_the_disk(int code) {
  switch (code) {
    case SQLITE_FULL:
    case SQLITE_IOERR:
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_PROTOCOL:
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return true;
    default:
      return false;
  }
}

class SqliteRows final : public Rows::Source {
 public:
  explicit SqliteRows(SQLite::Statement statement) : statement_(std::move(statement)) {}

  bool next() override {
    return with_our_errors([this] { return statement_.executeStep(); });
  }
  bool is_null(int column) const override {
    return with_our_errors([&] { return statement_.isColumnNull(column); });
  }
  std::int64_t integer64(int column) const override {
    return with_our_errors([&] { return statement_.getColumn(column).getInt64(); });
  }
  double number(int column) const override {
    return with_our_errors([&] { return statement_.getColumn(column).getDouble(); });
  }
  std::string text(int column) const override {
    return with_our_errors([&] { return statement_.getColumn(column).getString(); });
  }

 private:
  SQLite::Statement statement_;
};

/// SQLite treats `$1` as a name and numbers it by its first occurrence, so values are bound by
/// name.
void bind(SQLite::Statement& statement, int number, const SqlValue& value) {
  const std::string name = "$" + std::to_string(number);
  if (const auto* integer = std::get_if<std::int64_t>(&value))
    return statement.bind(name, *integer);
  if (const auto* real = std::get_if<double>(&value)) return statement.bind(name, *real);
  if (const auto* text = std::get_if<std::string_view>(&value))
    return statement.bind(name, std::string(*text));
  statement.bind(name);  // NULL
}

}  // namespace

DatabaseError error_of(const SQLite::Exception& error) {
  return {is_of_the_disk(error.getErrorCode()) ? DatabaseError::Kind::kAway
                                               : DatabaseError::Kind::kOther,
          error.what(), fmt::format("SQLite error {}", error.getExtendedErrorCode())};
}

SqliteDatabase::SqliteDatabase(const std::string& path, int flags, int busy_ms)
    : file_(with_our_errors([&] { return SQLite::Database(path, flags, busy_ms); })) {}

void SqliteDatabase::execute(const std::string& statements) {
  with_our_errors([&] { file_.exec(statements); });
}

SQLite::Statement SqliteDatabase::bound(const char* sql, Values values) {
  SQLite::Statement statement(file_, sql);
  int number = 0;
  for (const SqlValue& value : values) bind(statement, ++number, value);
  return statement;
}

Rows SqliteDatabase::run(const char* sql, Values values) {
  return with_our_errors([&] { return Rows(std::make_unique<SqliteRows>(bound(sql, values))); });
}

int SqliteDatabase::change(const char* sql, Values values) {
  return with_our_errors([&] { return bound(sql, values).exec(); });
}

bool SqliteDatabase::has_table(const std::string& name) {
  return with_our_errors([&] { return file_.tableExists(name); });
}

void SqliteDatabase::begin(bool writes) { execute(writes ? "BEGIN IMMEDIATE" : "BEGIN"); }

void SqliteDatabase::commit() { execute("COMMIT"); }

void SqliteDatabase::roll_back() noexcept {
  try {
    file_.exec("ROLLBACK");
  } catch (const SQLite::Exception&) {  // SQLite has rolled back by itself
  }
}

}  // namespace trammel
