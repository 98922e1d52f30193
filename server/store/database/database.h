#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "server/base/result.h"

/// The services that the store asks of a database: one text of SQL for SQLite and for PostgreSQL,
/// values bound to $1, $2..., rows, transactions, errors. Where the two differ it is said here and
/// nowhere else: is_shared() and schema_text.h.
namespace trammel {

/// A statement that failed. The text holds no bound value. It does not leave this room:
/// failure_of() makes an Error.
class DatabaseError : public std::runtime_error {
 public:
  enum class Kind {
    kAway,     ///< the database cannot be reached, or cannot be written now; it is tried again
    kAgain,    ///< others changed the same at the same time, or hold it locked: nothing was changed
    kUnknown,  ///< the connection was lost during a commit: whether it was made is not known
    kRefused,  ///< this database is not for us: no rights, a wrong password, no such database
    kBadValue,  ///< a value that the database does not take
    kOther
  };
  DatabaseError(Kind kind, const std::string& what, std::string code = {})
      : std::runtime_error(what), kind_(kind), code_(std::move(code)) {}
  [[nodiscard]] Kind kind() const { return kind_; }
  /// `SQLite error 13`, `PostgreSQL error 55P03`; may be empty.
  [[nodiscard]] const std::string& code() const { return code_; }

 private:
  Kind kind_;
  std::string code_;
};

/// The failure for a caller. kBusy: nothing was changed, or that is not known, and it may work
/// later.
[[nodiscard]] Failure failure_of(const DatabaseError& error, const std::string& place);

/// A value that is bound. Texts are not copied: they live until the statement is made.
using SqlValue = std::variant<std::nullptr_t, std::int64_t, double, std::string_view>;

template <typename Value>
[[nodiscard]] SqlValue sql_value(const Value& value) {
  if constexpr (std::is_integral_v<Value>) {
    return static_cast<std::int64_t>(value);
  } else if constexpr (std::is_floating_point_v<Value>) {
    return static_cast<double>(value);
  } else {
    return std::string_view(value);
  }
}
/// Empty is NULL.
template <typename Value>
[[nodiscard]] SqlValue sql_value(const std::optional<Value>& value) {
  return value ? sql_value(*value) : SqlValue(nullptr);
}

/// The rows of one statement, read one after the other. Columns are counted from 0.
class Rows {
 public:
  class Source {
   public:
    virtual ~Source() = default;
    virtual bool next() = 0;
    [[nodiscard]] virtual bool is_null(int column) const = 0;
    [[nodiscard]] virtual std::int64_t integer64(int column) const = 0;
    [[nodiscard]] virtual double number(int column) const = 0;
    [[nodiscard]] virtual std::string text(int column) const = 0;
  };
  explicit Rows(std::unique_ptr<Source> source) : source_(std::move(source)) {}

  /// False: there are no more.
  bool next() { return source_->next(); }
  [[nodiscard]] bool is_null(int column) const { return source_->is_null(column); }
  [[nodiscard]] std::int64_t integer64(int column) const { return source_->integer64(column); }
  [[nodiscard]] int integer(int column) const {
    return static_cast<int>(source_->integer64(column));
  }
  [[nodiscard]] bool truth(int column) const { return source_->integer64(column) != 0; }
  [[nodiscard]] double number(int column) const { return source_->number(column); }
  /// Bytes as they are; a number as it is written.
  [[nodiscard]] std::string text(int column) const { return source_->text(column); }

 private:
  std::unique_ptr<Source> source_;
};

/// One connection, for one thread at a time. All of it throws DatabaseError.
class Database {
 public:
  using Values = std::span<const SqlValue>;
  virtual ~Database() = default;

  /// Statements without values, one after the other.
  virtual void execute(const std::string& statements) = 0;
  /// A statement that has rows, also one that changes something and returns rows: that is made with
  /// the first next().
  [[nodiscard]] virtual Rows run(const char* sql, Values values) = 0;
  [[nodiscard]] Rows run(const char* sql, std::initializer_list<SqlValue> values) {
    return run(sql, Values(values.begin(), values.size()));
  }
  /// A statement that changes something; returns how many rows it changed.
  virtual int change(const char* sql, Values values) = 0;
  int change(const char* sql, std::initializer_list<SqlValue> values) {
    return change(sql, Values(values.begin(), values.size()));
  }
  [[nodiscard]] virtual bool has_table(const std::string& name) = 0;
  /// Several processes write it at a time: what a decision rests on is locked row by row, and there
  /// are roles.
  [[nodiscard]] virtual bool is_shared() const = 0;
  /// The open transaction is of a size of its own (a whole store is read or written): it may take
  /// its time, also between two statements.
  virtual void take_long() {}

  /// The server that writes, for the audit trail; empty: one that has the store alone, or a
  /// command.
  void written_by(std::string server) { writer_ = std::move(server); }
  [[nodiscard]] const std::string& writer() const { return writer_; }

  /// Work that the open transaction does as its last, just before it is committed: what everybody
  /// waits for is locked for as short as can be, and always in the same order.
  void at_end(std::function<void(Database&)> work) { last_.push_back(std::move(work)); }

 private:
  friend class Transaction;
  virtual void begin(bool writes) = 0;
  virtual void commit() = 0;
  virtual void roll_back() noexcept = 0;

  std::vector<std::function<void(Database&)>> last_;
  std::string writer_;
};

/// Everything until commit(), or nothing. What it reads is of one moment if it only reads.
class Transaction {
 public:
  enum class For { kReading, kWriting };
  Transaction(Database& database, For what);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// Does what is to be done last; commit() does it where nobody has.
  void do_last();
  void commit();

 private:
  Database& database_;
  bool open_ = true;
};

/// The first column of the first row; 0 and empty where there is none.
[[nodiscard]] std::int64_t integer_of(Database& database, const char* sql);
[[nodiscard]] std::string text_of(Database& database, const char* sql);

}  // namespace trammel
