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

/// The operations that the store needs from a database: one text of SQL for SQLite and for
/// PostgreSQL, values bound to $1, $2..., rows, transactions, errors. Their differences are only
/// here: in is_shared() and schema_text.h.
namespace trammel {

/// A failed statement. The text has no bound values. It does not leave this room: failure_of()
/// makes an Error.
class DatabaseError : public std::runtime_error {
 public:
  enum class Kind {
    kAway,   ///< the database cannot be reached, or cannot be written now; a later try may succeed
    kAgain,  ///< others changed the same at the same time, or hold it locked: nothing was changed
             ///< here
    kUnknown,   ///< the connection was lost during a commit: the outcome is unknown
    kRefused,   ///< no access: no rights, a wrong password, no such database
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

/// The failure for a caller. kBusy: either nothing was changed or the outcome is unknown, and a
/// later try may succeed.
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
  /// Bytes unchanged; a number in its written form.
  [[nodiscard]] std::string text(int column) const { return source_->text(column); }

 private:
  std::unique_ptr<Source> source_;
};

/// One connection, for one thread at a time. All functions throw DatabaseError.
class Database {
 public:
  using Values = std::span<const SqlValue>;
  virtual ~Database() = default;

  /// Statements without values, one after the other.
  virtual void execute(const std::string& statements) = 0;
  /// Runs a statement with rows. A statement that changes data and returns rows makes the change at
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
  /// True if several processes write it at a time. Then the rows behind a decision are locked one
  /// by one, and there are roles.
  [[nodiscard]] virtual bool is_shared() const = 0;
  /// The open transaction is of a size of its own (a whole store is read or written): it may take
  /// its time, also between two statements.
  virtual void take_long() {}

  /// The server that writes, for the audit trail; empty: one that has the store alone, or a
  /// command.
  void written_by(std::string server) { writer_ = std::move(server); }
  [[nodiscard]] const std::string& writer() const { return writer_; }

  /// Work that the open transaction does last, just before it is committed. It locks rows for which
  /// everybody waits, so the locks are short and always in the same order.
  void at_end(std::function<void(Database&)> work) { last_.push_back(std::move(work)); }

 private:
  friend class Transaction;
  virtual void begin(bool writes) = 0;
  virtual void commit() = 0;
  virtual void roll_back() noexcept = 0;

  std::vector<std::function<void(Database&)>> last_;
  std::string writer_;
};

/// All changes until commit(), or none. A transaction that only reads sees one moment.
class Transaction {
 public:
  enum class For { kReading, kWriting };
  Transaction(Database& database, For what);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// Does the postponed work; commit() calls it otherwise.
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
