#include "server/store/database/postgres_database.h"

#include <poll.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <random>
#include <vector>

#include "server/store/database/host_addresses.h"
#include "server/store/database/postgres_settings.h"

namespace trammel {
namespace {

using std::chrono::milliseconds;
using Kind = DatabaseError::Kind;

constexpr milliseconds kPerHost{1000};  // for one connection attempt
constexpr milliseconds kAnswer{6000};   // longer than the server's own limit below
constexpr milliseconds kCommit{10000};  // which may include waiting for a standby
constexpr milliseconds kLongWork{600000};
constexpr milliseconds kSlice{250};    // until a call hears that it may wait no longer
constexpr int kOldestServer = 130000;  // gen_random_uuid()
constexpr const char* kLimits =
    "SET LOCAL statement_timeout = '5s'; SET LOCAL lock_timeout = '1s'; SET LOCAL "
    "idle_in_transaction_session_timeout = '10s'";

constexpr std::string_view kWarning = "01000", kReadOnly = "25006";

/// OIDs of the types that the store has (pg_type.dat).
constexpr Oid kBool = 16, kInt8 = 20, kInt2 = 21, kInt4 = 23, kFloat8 = 701;

bool begins_with_one_of(std::string_view code, std::initializer_list<std::string_view> beginnings) {
  return std::any_of(beginnings.begin(), beginnings.end(),
                     [&](auto one) { return code.starts_with(one); });
}

Kind kind_of(std::string_view code) {
  if (begins_with_one_of(code, {"40001", "40P01", "55P03", "57014", "23505"})) return Kind::kAgain;
  if (begins_with_one_of(code, {"08", "25006", "53", "57P", "58"})) return Kind::kAway;
  if (begins_with_one_of(code, {"28", "3D000", "42501"})) return Kind::kRefused;
  return code.starts_with("22") ? Kind::kBadValue : Kind::kOther;
}

std::string first_line(const char* text) {
  const std::string_view all(text == nullptr ? "" : text);
  return std::string(all.substr(0, all.find('\n')));
}

/// Without the values that a detail, or the text of a bad value, would repeat.
DatabaseError error_of(const PGresult* answer) {
  const char* code = ::PQresultErrorField(answer, PG_DIAG_SQLSTATE);
  if (code == nullptr) return {Kind::kAway, first_line(::PQresultErrorMessage(answer))};
  const Kind kind = kind_of(code);
  const char* said = ::PQresultErrorField(answer, PG_DIAG_MESSAGE_PRIMARY);
  return {kind,
          kind == Kind::kBadValue ? "a value that a text or a number of the database cannot hold"
                                  : said,
          fmt::format("PostgreSQL error {}", code)};
}

/// The byte that comes over the line first is the highest.
template <typename Number>
Number from_wire(const char* bytes) {
  Number value{};
  for (std::size_t i = 0; i < sizeof value; ++i)
    value = static_cast<Number>(value << 8 | static_cast<unsigned char>(bytes[i]));
  return value;
}

class PostgresRows final : public Rows::Source {
 public:
  explicit PostgresRows(std::unique_ptr<PGresult, void (*)(PGresult*)> answer)
      : answer_(std::move(answer)) {}

  bool next() override { return ++row_ < ::PQntuples(answer_.get()); }
  bool is_null(int column) const override {
    return ::PQgetisnull(answer_.get(), row_, column) != 0;
  }
  std::int64_t integer64(int column) const override {
    if (is_null(column)) return 0;
    switch (::PQftype(answer_.get(), column)) {
      case kBool:
        return *bytes(column) != 0 ? 1 : 0;
      case kInt2:
        return static_cast<std::int16_t>(from_wire<std::uint16_t>(bytes(column)));
      case kInt4:
        return static_cast<std::int32_t>(from_wire<std::uint32_t>(bytes(column)));
      case kInt8:
        return static_cast<std::int64_t>(from_wire<std::uint64_t>(bytes(column)));
      default:
        throw DatabaseError(Kind::kOther, fmt::format("column {} is no number", column));
    }
  }
  double number(int column) const override {
    if (is_null(column)) return 0;
    if (::PQftype(answer_.get(), column) != kFloat8) return static_cast<double>(integer64(column));
    return std::bit_cast<double>(from_wire<std::uint64_t>(bytes(column)));
  }
  std::string text(int column) const override {
    if (is_null(column)) return "";
    const Oid type = ::PQftype(answer_.get(), column);
    if (type == kInt2 || type == kInt4 || type == kInt8) return std::to_string(integer64(column));
    return {bytes(column), static_cast<std::size_t>(::PQgetlength(answer_.get(), row_, column))};
  }

 private:
  [[nodiscard]] const char* bytes(int column) const {
    return ::PQgetvalue(answer_.get(), row_, column);
  }

  std::unique_ptr<PGresult, void (*)(PGresult*)> answer_;
  int row_ = -1;
};

/// Values as libpq takes them. Texts go as bytes with a length: as a C string they would end at the
/// first NUL.
class Bound {
 public:
  explicit Bound(Database::Values values) {
    spelled_.reserve(values.size());
    for (const SqlValue& value : values) add(value);
  }
  [[nodiscard]] int size() const { return static_cast<int>(starts_.size()); }
  [[nodiscard]] const char* const* starts() const { return starts_.data(); }
  [[nodiscard]] const int* lengths() const { return lengths_.data(); }
  [[nodiscard]] const int* formats() const { return formats_.data(); }

 private:
  void add(const SqlValue& value) {
    if (const auto* text = std::get_if<std::string_view>(&value))
      return add(text->empty() ? "" : text->data(), text->size(), 1);
    if (std::holds_alternative<std::nullptr_t>(value)) return add(nullptr, 0, 0);
    const auto* integer = std::get_if<std::int64_t>(&value);
    spelled_.push_back(integer != nullptr ? std::to_string(*integer)
                                          : fmt::format("{:.17g}", std::get<double>(value)));
    add(spelled_.back().c_str(), spelled_.back().size(), 0);
  }
  void add(const char* start, std::size_t length, int format) {
    starts_.push_back(start);
    lengths_.push_back(static_cast<int>(length));
    formats_.push_back(format);
  }

  std::vector<std::string> spelled_;
  std::vector<const char*> starts_;
  std::vector<int> lengths_, formats_;
};

/// True if the socket is ready by the deadline, and before the patience ends.
bool is_ready(int socket, short events, std::chrono::steady_clock::time_point deadline,
              const Patience& patience) {
  pollfd one{socket, events, 0};
  for (;;) {
    const auto left = std::chrono::ceil<milliseconds>(patience.limited(deadline) -
                                                      std::chrono::steady_clock::now());
    if (left.count() <= 0) return false;
    const int ready = ::poll(&one, 1, static_cast<int>(std::min(left, kSlice).count()));
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
}

/// Takes the steps of connecting; empty: it is connected. libpq knows no deadline here.
std::string why_not_connected(PGconn* connection, const Patience& patience) {
  const auto deadline = std::chrono::steady_clock::now() + kPerHost;
  for (auto state = PGRES_POLLING_WRITING; state != PGRES_POLLING_OK;
       state = ::PQconnectPoll(connection)) {
    if (state == PGRES_POLLING_FAILED || ::PQstatus(connection) == CONNECTION_BAD)
      return first_line(::PQerrorMessage(connection));
    if (!is_ready(::PQsocket(connection), state == PGRES_POLLING_READING ? POLLIN : POLLOUT,
                  deadline, patience))
      return fmt::format("{} did not answer within {} ms", ::PQhost(connection), kPerHost.count());
  }
  return "";
}

/// True for errors of certificates and keys, which do not go away by themselves. A line that breaks
/// during the handshake gives none of these messages.
bool is_of_certificates(const std::string& told) {
  constexpr std::array kWords = {"certificate", "private key", "alert unknown ca",
                                 "does not support SSL"};
  return std::any_of(kWords.begin(), kWords.end(),
                     [&](const char* word) { return told.find(word) != std::string::npos; });
}

/// True for a refusal that is permanent. A server that answers but rejects all logins now may
/// accept them later. Without a connection libpq has no SQLSTATE, so this compares the words of the
/// server, and of libpq.
bool is_refused_for_good(PGconn* connection, const std::string& told) {
  if (::PQconnectionNeedsPassword(connection) != 0) return true;
  const std::size_t at = told.find("FATAL:");
  if (at == std::string::npos) return is_of_certificates(told);
  const auto says = [answer = told.substr(at)](const char* text) {
    return answer.find(text) != std::string::npos;
  };
  // The last four are messages of a pooler without its server.
  constexpr std::array kForNow = {
      "starting up", "not yet accepting", "shutting down",      "recovery",       "too many",
      "slots",       "server login",      "query_wait_timeout", "cannot connect", "connect failed"};
  return std::none_of(kForNow.begin(), kForNow.end(), says);
}

/// The server's state at connection time; a pooler may leave it out.
bool is_read_only(PGconn* connection, Database& database) {
  const char* standby = ::PQparameterStatus(connection, "in_hot_standby");
  if (standby == nullptr) return integer_of(database, "SELECT pg_is_in_recovery()") != 0;
  const char* by_default = ::PQparameterStatus(connection, "default_transaction_read_only");
  const auto is_on = [](const char* setting) {
    return setting != nullptr && std::string_view(setting) == "on";
  };
  return is_on(standby) || is_on(by_default);
}

}  // namespace

PostgresDatabase::PostgresDatabase(Connection connection, std::shared_ptr<const Patience> patience)
    : connection_(std::move(connection)), patience_(std::move(patience)) {
  ::PQsetNoticeReceiver(connection_.get(), &PostgresDatabase::note_warning, this);
  ::PQsetnonblocking(connection_.get(), 1);
}

Result<std::unique_ptr<PostgresDatabase>> PostgresDatabase::connect_to_one(
    const PostgresSettings& settings, Session session,
    const std::shared_ptr<const Patience>& patience) {
  std::vector<const char*> keys, values;
  for (const auto& [key, value] : settings) {
    keys.push_back(key.c_str());
    values.push_back(value.c_str());
  }
  keys.push_back(nullptr);
  values.push_back(nullptr);
  Connection connection(::PQconnectStartParams(keys.data(), values.data(), 0), &::PQfinish);
  if (!connection) return failure(ErrorCode::kInternal, "no memory for a connection");
  if (const std::string why = why_not_connected(connection.get(), *patience); !why.empty()) {
    const bool for_good = is_refused_for_good(connection.get(), why);
    return failure(for_good ? ErrorCode::kRefused : ErrorCode::kUnreachable, "{}", why)
        .next(for_good ? "mend the URL, or what the database allows"
                       : "see that PostgreSQL runs there");
  }
  if (const int version = ::PQserverVersion(connection.get()); version < kOldestServer)
    return refused("PostgreSQL {} is too old, limit {}", version / 10000, kOldestServer / 10000)
        .beyond(version / 10000, kOldestServer / 10000);
  std::unique_ptr<PostgresDatabase> made(new PostgresDatabase(std::move(connection), patience));
  try {
    if (session == Session::kWrites && is_read_only(made->connection_.get(), *made))
      return failure(ErrorCode::kUnreachable, "{} is a read-only standby",
                     ::PQhost(made->connection_.get()))
          .next("name the primary, or all hosts of the cluster");
  } catch (const DatabaseError& error) {
    return failure(ErrorCode::kUnreachable, "{}", error.what());
  }
  return made;
}

Result<std::unique_ptr<PostgresDatabase>> PostgresDatabase::connect(
    const std::string& url, Session session, std::shared_ptr<const Patience> patience) {
  auto hosts = TRY(settings_of(url));
  std::shuffle(hosts.begin(), hosts.end(), std::mt19937_64(std::random_device{}()));
  std::optional<Error> why;
  const auto keep = [&why](const Error& error) {
    if (!why || error.code == ErrorCode::kRefused) why = error;
  };
  for (const PostgresSettings& host : hosts) {
    if (patience->is_over()) {
      keep(failure(ErrorCode::kUnreachable, "the service ends").value());
      break;
    }
    const auto places = with_addresses(host, kPerHost);
    if (!places) {
      keep(places.error());
      continue;
    }
    for (const PostgresSettings& place : *places) {
      auto made = connect_to_one(place, session, patience);
      if (made) return made;
      keep(made.error());
    }
  }
  return tl::make_unexpected(*why);
}

void PostgresDatabase::note_warning(void* self, const PGresult* warning) {
  const char* code = ::PQresultErrorField(warning, PG_DIAG_SQLSTATE);
  if (code != nullptr && std::string_view(code) == kWarning)
    static_cast<PostgresDatabase*>(self)->warned_ = true;
}

void PostgresDatabase::lose(const std::string& why) {
  lost_ = true;
  throw DatabaseError(Kind::kAway, why.empty() ? "the connection was lost" : why);
}

void PostgresDatabase::check_sent(int sent) {
  if (sent == 0) lose(first_line(::PQerrorMessage(connection_.get())));
}

void PostgresDatabase::wait(short events, Deadline deadline) {
  if (!is_ready(::PQsocket(connection_.get()), events, deadline, *patience_))
    lose("the database does not answer");
}

PostgresDatabase::Answer PostgresDatabase::answer(Deadline deadline) {
  PGconn* connection = connection_.get();
  for (int left = ::PQflush(connection); left != 0; left = ::PQflush(connection)) {
    if (left < 0) lose(first_line(::PQerrorMessage(connection)));
    wait(POLLIN | POLLOUT, deadline);
    check_sent(::PQconsumeInput(connection));
  }
  Answer last(nullptr, &::PQclear);
  for (;;) {
    while (::PQisBusy(connection) != 0) {
      wait(POLLIN, deadline);
      check_sent(::PQconsumeInput(connection));
    }
    Answer next(::PQgetResult(connection), &::PQclear);
    if (!next) break;
    const bool failed = last && ::PQresultStatus(last.get()) == PGRES_FATAL_ERROR;
    if (!failed) last = std::move(next);
  }
  if (!last || ::PQstatus(connection) == CONNECTION_BAD)
    lose(first_line(::PQerrorMessage(connection)));
  const auto status = ::PQresultStatus(last.get());
  if (status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK) return last;
  const char* code = ::PQresultErrorField(last.get(), PG_DIAG_SQLSTATE);
  if (code != nullptr && std::string_view(code) == kReadOnly)
    lost_ = true;  // another host takes changes now
  throw error_of(last.get());
}

PostgresDatabase::Answer PostgresDatabase::ask(const char* sql, Values values) {
  if (lost_) lose("");
  const Bound bound(values);
  check_sent(::PQsendQueryParams(connection_.get(), sql, bound.size(), nullptr, bound.starts(),
                                 bound.lengths(), bound.formats(), 1));
  return answer(by_when(kAnswer));
}

void PostgresDatabase::execute(const std::string& statements) {
  if (lost_) lose("");
  check_sent(::PQsendQuery(connection_.get(), statements.c_str()));
  static_cast<void>(answer(by_when(kAnswer)));
}

PostgresDatabase::Deadline PostgresDatabase::by_when(milliseconds limit) const {
  return std::chrono::steady_clock::now() + (takes_long_ ? std::max(limit, kLongWork) : limit);
}

void PostgresDatabase::take_long() {
  execute("SET LOCAL statement_timeout = 0; SET LOCAL idle_in_transaction_session_timeout = 0");
  takes_long_ = true;
}

bool PostgresDatabase::hears(milliseconds limit) {
  if (lost_) lose("");
  if (is_ready(::PQsocket(connection_.get()), POLLIN, std::chrono::steady_clock::now() + limit,
               *patience_))
    check_sent(::PQconsumeInput(connection_.get()));
  return take_words();
}

bool PostgresDatabase::take_words() {
  bool any = false;
  while (PGnotify* word = ::PQnotifies(connection_.get())) {
    any = true;
    ::PQfreemem(word);
  }
  return any;
}

Rows PostgresDatabase::run(const char* sql, Values values) {
  return Rows(std::make_unique<PostgresRows>(ask(sql, values)));
}

int PostgresDatabase::change(const char* sql, Values values) {
  const std::string count = ::PQcmdTuples(ask(sql, values).get());
  return count.empty() ? 0 : std::stoi(count);
}

bool PostgresDatabase::has_table(const std::string& name) {
  const std::array<SqlValue, 1> values = {sql_value(name)};
  Rows row = run("SELECT to_regclass($1) IS NOT NULL", values);
  return row.next() && row.truth(0);
}

void PostgresDatabase::begin(bool writes) {
  takes_long_ = false;
  static_cast<void>(
      take_words());  // left from a session that listened before a pooler passed the connection on
  execute(fmt::format("BEGIN ISOLATION LEVEL {}; {}",
                      writes ? "READ COMMITTED READ WRITE" : "REPEATABLE READ READ ONLY", kLimits));
}

void PostgresDatabase::commit() {
  warned_ = false;
  try {
    if (lost_) lose("");
    check_sent(::PQsendQuery(connection_.get(), "COMMIT"));
    const Answer made = answer(by_when(kCommit));
    if (std::strcmp(::PQcmdStatus(made.get()), "COMMIT") != 0)
      throw DatabaseError(Kind::kAgain, "the transaction was rolled back");
  } catch (const DatabaseError& error) {
    // It is unknown whether the server made the commit, or will still make it.
    if (error.kind() == Kind::kAway)
      throw DatabaseError(Kind::kUnknown, error.what(), error.code());
    throw;
  }
  // The server reports success, but the change is on this host alone, since the wait for the
  // standby was cancelled.
  if (warned_)
    throw DatabaseError(Kind::kUnknown, "the standby has not confirmed it", "PostgreSQL 01000");
}

std::string who_holds(Database& database, Locked what) {
  try {
    const std::string query = fmt::format(
        "SELECT a.application_name, a.usename, a.pid FROM pg_locks AS l JOIN pg_stat_activity AS a "
        "ON a.pid = l.pid JOIN pg_class AS c ON c.oid = l.relation WHERE l.granted AND l.mode {} "
        "AND a.pid <> pg_backend_pid() AND a.datname = current_database() AND a.usename IS NOT "
        "NULL AND c.relnamespace = to_regnamespace(current_schema()) AND "
        "COALESCE(a.application_name, '') <> 'trammel' ORDER BY a.xact_start, a.pid LIMIT 1",
        what == Locked::kRows ? "<> 'AccessShareLock'" : "= 'AccessExclusiveLock'");
    Rows row = database.run(query.c_str(), Database::Values());
    if (!row.next()) return "";
    return fmt::format("{} of role {} (process {}) holds rows locked", row.text(0), row.text(1),
                       row.integer(2));
  } catch (const DatabaseError&) {
    return "";
  }
}

void PostgresDatabase::roll_back() noexcept {
  try {
    if (!lost_) execute("ROLLBACK");
  } catch (const std::exception&) {
    lost_ = true;
  }
}

}  // namespace trammel
