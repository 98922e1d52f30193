#pragma once

#include <postgresql/libpq-fe.h>

#include <chrono>
#include <memory>
#include <string>

#include "server/store/database/database.h"
#include "server/store/database/patience.h"

namespace trammel {

/// A connection to PostgreSQL. Every call has a deadline of its own, since no other timeout works
/// for a server that is suspended but not dead. Statements are unnamed, and settings last one
/// transaction, so a pooler may be in between.
class PostgresDatabase final : public Database {
 public:
  enum class Session { kMayBeReadOnly, kWrites };

  /// Tries the hosts of the URL one after the other, in random order. Refuses (kUnreachable) if
  /// none answers. Refuses (kRefused) if one rejects the login, or if all that answer are read-only
  /// although `session` must write.
  [[nodiscard]] static Result<std::unique_ptr<PostgresDatabase>> connect(
      const std::string& url, Session session,
      std::shared_ptr<const Patience> patience = std::make_shared<Patience>());

  using Database::change;
  using Database::run;
  void execute(const std::string& statements) override;
  [[nodiscard]] Rows run(const char* sql, Values values) override;
  int change(const char* sql, Values values) override;
  [[nodiscard]] bool has_table(const std::string& name) override;
  [[nodiscard]] bool is_shared() const override { return true; }
  void take_long() override;

  /// True if a notification of a subscribed channel arrived within `limit`.
  [[nodiscard]] bool hears(std::chrono::milliseconds limit);

  /// The connection is lost, or an answer did not come in time, so the connection is no longer
  /// usable.
  [[nodiscard]] bool is_lost() const { return lost_; }

 private:
  using Connection = std::unique_ptr<PGconn, void (*)(PGconn*)>;
  using Answer = std::unique_ptr<PGresult, void (*)(PGresult*)>;
  using Deadline = std::chrono::steady_clock::time_point;

  PostgresDatabase(Connection connection, std::shared_ptr<const Patience> patience);
  [[nodiscard]] static Result<std::unique_ptr<PostgresDatabase>> connect_to_one(
      const std::vector<std::pair<std::string, std::string>>& settings, Session session,
      const std::shared_ptr<const Patience>& patience);
  static void note_warning(void* self, const PGresult* warning);

  void begin(bool writes) override;
  void commit() override;
  void roll_back() noexcept override;

  [[nodiscard]] Answer ask(const char* sql, Values values);
  /// The last answer to the query.
  [[nodiscard]] Answer answer(Deadline deadline);
  [[nodiscard]] Deadline by_when(std::chrono::milliseconds limit) const;
  void wait(short events, Deadline deadline);
  /// Drops the received messages; returns whether there were any.
  bool take_words();
  [[noreturn]] void lose(const std::string& why);
  void check_sent(int sent);

  Connection connection_;
  std::shared_ptr<const Patience> patience_;
  bool lost_ = false;
  bool warned_ = false;      // a warning came: during a commit, that no standby has confirmed it
  bool takes_long_ = false;  // of the open transaction
};

/// The sessions that hold rows or tables of the store locked, longest first, for people. Empty if
/// there are none, or if they are not known.
enum class Locked { kRows, kForReaders };
[[nodiscard]] std::string who_holds(Database& database, Locked what);

}  // namespace trammel
