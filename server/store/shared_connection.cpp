#include "server/store/shared_connection.h"

#include <algorithm>
#include <random>
#include <utility>

#include "server/store/audit_rows.h"
#include "server/store/moved.h"
#include "server/store/schema.h"
#include "server/store/shared_schema.h"
#include "server/store/store_place.h"

namespace trammel {
namespace {

constexpr std::size_t kMostConnections = 4;
constexpr std::size_t kMostWithHeartbeat = kMostConnections + 1;
constexpr std::chrono::seconds kPatience{1};  // for a connection that others use, and for locks
constexpr int kMostTries = 5;

/// The pause grows with each try and has a random part, so that those who collided do not collide
/// again.
std::chrono::milliseconds pause_after(int tries) {
  thread_local std::mt19937 random(std::random_device{}());
  return std::chrono::milliseconds(std::uniform_int_distribution<int>(1, 20 * tries)(random));
}

}  // namespace

SharedConnection::SharedConnection(std::string url, std::unique_ptr<ServedCopies> kept)
    : StoreConnection(spoken_place(url), std::move(kept)), url_(std::move(url)) {}

Result<std::unique_ptr<StoreConnection>> SharedConnection::open(const std::string& url,
                                                                const std::string& cache) {
  std::unique_ptr<SharedConnection> made(
      new SharedConnection(url, std::make_unique<ServedCopies>(cache)));
  auto connected =
      PostgresDatabase::connect(url, PostgresDatabase::Session::kWrites, made->patience_);
  const auto stores = made->copies->stores();
  if (connected) {
    TRY(made->admit(**connected));
    made->give_back(std::move(*connected));
  } else {
    Failure why = Failure(connected.error()).in(made->path);
    if (why.value().code != ErrorCode::kUnreachable && stores.empty()) return why;
    if (!stores.empty()) static_cast<void>(made->copies->belong_to(stores.front(), false));
    made->note_trouble(std::move(why).as(ErrorCode::kBusy).value(), true);
  }
  return made;
}

Status SharedConnection::admit(Database& database) {
  try {
    TRY(check_shared_schema(database, path));
    TRY(check_not_moved(database, path));
    const std::string id = text_of(database, "SELECT id FROM store_identity WHERE id <> ''");
    const auto known = copies->stores();
    if (!known.empty() && std::find(known.begin(), known.end(), id) == known.end())
      return failure(ErrorCode::kInternal,
                     "another store than the one that served here, whose copies are in {}",
                     copies->root())
          .in(path)
          .next("name the right one, or move the copies away if it is meant to be another");
    const MutexLock guard(mutex_);
    if (!identity_.empty() && identity_ != id)
      return failure(ErrorCode::kInternal, "was replaced by another store while it is served from")
          .in(path)
          .next("put the right one back, or start the service again");
    if (identity_.empty()) static_cast<void>(copies->belong_to(id, true));
    identity_ = id;
    return {};
  } catch (const DatabaseError& error) {
    return failure_of(error, path);
  }
}

Result<SharedConnection::Connected> SharedConnection::connect() {
  auto connected = PostgresDatabase::connect(url_, PostgresDatabase::Session::kWrites, patience_);
  if (!connected) return Failure(connected.error()).in(path);
  TRY(admit(**connected));
  return connected;
}

Result<SharedConnection::Connected> SharedConnection::borrow(std::size_t most) {
  {
    MutexLock guard(mutex_);
    const bool free =
        given_back_.wait_until(guard, Clock::now() + kPatience,
                               [this, most]() TRAMMEL_REQUIRES(mutex_) { return lent_ < most; });
    if (!free)
      return failure(ErrorCode::kBusy, "all {} connections are in use", lent_)
          .in(path)
          .next("ask again");
    ++lent_;
    if (!idle_.empty()) {
      Connected connected = std::move(idle_.back());
      idle_.pop_back();
      return connected;
    }
  }
  auto connected = connect();
  if (!connected) give_back(nullptr);
  return connected;
}

void SharedConnection::give_back(Connected connected) {
  {
    const MutexLock guard(mutex_);
    if (lent_ > 0) --lent_;
    if (connected && connected->is_lost()) {  // the failure of one connection affects all
      idle_.clear();
      listener_may_be_lost_ = true;  // a host that is frozen does not say so
    }
    if (connected && !connected->is_lost()) idle_.push_back(std::move(connected));
  }
  given_back_.notify_all();  // wakes all, since the waiting calls have different limits
}

Status SharedConnection::read(const Job& job) {
  if (const StoreState now = state(); !now.readable)
    return tl::make_unexpected(*now.why_not_written);
  return run(job, Transaction::For::kReading, kMostConnections);
}

Status SharedConnection::write(const Job& job) {
  if (const auto why = state().why_not_written) return tl::make_unexpected(*why);
  return run(job, Transaction::For::kWriting, kMostConnections);
}

Status SharedConnection::write_urgently(const Job& job) {
  if (const auto why = state().why_not_written) return tl::make_unexpected(*why);
  return run(job, Transaction::For::kWriting, kMostWithHeartbeat);
}

Status SharedConnection::run(const Job& job, Transaction::For what, std::size_t most) {
  const auto until = Clock::now() + kPatience;
  for (int tries = 1;; ++tries) {
    auto connected = borrow(most);
    if (!connected) {
      const Error why = Failure(connected.error()).as(ErrorCode::kBusy).value();
      if (connected.error().code != ErrorCode::kBusy) note_trouble(why, true);
      return tl::make_unexpected(why);
    }
    Status result;
    std::optional<DatabaseError> failed;
    try {
      Transaction transaction(**connected, what);
      (*connected)->written_by(worker.server);
      result = job(**connected);
      if (result) transaction.commit();
    } catch (const DatabaseError& error) {
      failed = error;
    } catch (const std::exception& error) {
      result = failure(ErrorCode::kInternal, "{}", error.what()).in(path);
    }
    const bool lost = (*connected)->is_lost();
    const bool in_the_way = failed && failed->kind() == DatabaseError::Kind::kAgain;
    const bool gives_up = !in_the_way || tries == kMostTries || Clock::now() >= until;
    const std::string who =
        in_the_way && gives_up && !lost ? who_holds(**connected, Locked::kRows) : "";
    give_back(std::move(*connected));
    if (!failed) {
      if (result && what == Transaction::For::kWriting) note_written();
      return result;
    }
    const bool is_away = failed->kind() == DatabaseError::Kind::kAway;
    if (gives_up && !(is_away && lost && tries == 1)) {
      Failure said = failure_of(*failed, path);
      if (!who.empty()) said.value().message += "; " + who;
      // A store that cannot even be read is away for all threads, until try_again() sees it again.
      const bool unreadable = in_the_way && what == Transaction::For::kReading;
      if (is_away || unreadable) note_trouble(said.value(), lost || unreadable);
      return said;
    }
    wait_without_word({}, Clock::now() + pause_after(tries));
  }
}

bool SharedConnection::hears_of_change(const std::stop_token& stop, Clock::time_point until) {
  constexpr std::chrono::milliseconds kSlice{200};  // longest delay until a stop is noticed
  try {
    if (listener_may_be_lost_.exchange(false)) listener_.reset();
    if (!listener_) {
      auto connected = connect();
      if (!connected) return false;
      listener_ = std::move(*connected);
      listener_->execute(fmt::format("LISTEN {}", kChangesChannel));
      return true;
    }
    while (!stop.stop_requested() && Clock::now() < until) {
      if (listener_->hears(kSlice)) return true;
    }
  } catch (const DatabaseError&) {
    listener_.reset();
  }
  return false;
}

void SharedConnection::wait_for_change(const std::stop_token& stop,
                                       std::chrono::milliseconds limit) {
  const auto until = Clock::now() + limit;
  if (state().readable && hears_of_change(stop, until)) return;
  wait_without_word(stop, until);
}

Status SharedConnection::try_again() {
  if (!state().why_not_written) return {};
  return run(
      [this](Database& database) -> Status {
        change(database, "UPDATE store_identity SET id = id");
        if (const std::string who = who_holds(database, Locked::kForReaders); !who.empty())
          return failure(ErrorCode::kBusy, "{}", who).in(path);
        return check_not_moved(database, path);
      },
      Transaction::For::kWriting, kMostConnections);
}

}  // namespace trammel
