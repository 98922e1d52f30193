#include "server/store/connection.h"

#include <algorithm>

#include "server/base/unix_time.h"
#include "server/store/audit_rows.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kBetweenTries{1};  // to open a file that cannot be written
constexpr std::size_t kMostDamages = 100;         // that are told

}  // namespace

StoreConnection::StoreConnection(WriterLock writer, StoreFile held, std::string name, OpenedDatabase opened,
                                 std::unique_ptr<ServedCopies> kept)
    : path(std::move(name)),
      lock(std::move(writer)),
      copies(std::move(kept)),
      file(std::move(held)),
      database(std::move(opened.file)) {
  const MutexLock guard(mutex);
  must_be_opened_anew_ = opened.why_not_written.has_value();
  if (must_be_opened_anew_) {
    note_trouble(*opened.why_not_written, database == nullptr);
  } else {
    note_opened();
  }
}

StoreConnection::~StoreConnection() {
  const MutexLock guard(mutex);
  const auto finding = file.look();
  if (finding == StoreFile::Finding::kGone || finding == StoreFile::Finding::kAnother) leave_no_journal();
}

void StoreConnection::note_opened() {
  was_written_ = true;
  mark_ = mark_of(*database);
  file.remember();
  const std::int64_t behind = last_audit_at(*database) - unix_now();
  const MutexLock guard(state_mutex);
  if (behind >= ClockWatch::kNoticed.count() && state_now.clock.empty())
    state_now.clock = fmt::format(
        "the host's clock is {} s behind the last change in the store: one of the two is dated "
        "wrongly (trammel audit shows them)",
        behind);
}

bool StoreConnection::is_in_order() {
  const MutexLock guard(mutex);
  return !must_be_opened_anew_ && !state().why_not_written && file.look() == StoreFile::Finding::kAsLeft;
}

Status StoreConnection::be_sure_of_file() {
  if (!must_be_opened_anew_) {
    if (file.look() == StoreFile::Finding::kAsLeft) return {};
    must_be_opened_anew_ = true;
    tried_last_ = {};
  }
  const auto now = std::chrono::steady_clock::now();
  if (const auto why = state().why_not_written; why && now < tried_last_ + kBetweenTries)
    return tl::make_unexpected(*why);
  tried_last_ = now;
  return open_anew();
}

Status StoreConnection::open_anew() {
  const Status as_left = was_written_ ? check_as_left() : Status();
  Status opened = as_left ? opened_anew() : as_left;
  if (!opened) {
    // Whoever asked a service that was well asks again; see failure_of().
    if (was_written_) opened = tl::make_unexpected(Failure(opened.error()).as(ErrorCode::kBusy).value());
    note_trouble(opened.error(), database == nullptr);
  }
  return opened;
}

Status StoreConnection::opened_anew() {
  database.reset();  // one connection at a time: its locks are the process's
  if (auto held = file.hold(); !held) return held;
  auto opened = open_database(path, *copies);
  if (!opened) return tl::make_unexpected(opened.error());
  database = std::move(opened->file);
  if (opened->why_not_written) return tl::make_unexpected(*opened->why_not_written);
  if (auto held = file.hold(); !held) return held;
  note_opened();
  must_be_opened_anew_ = false;
  return {};
}

Status StoreConnection::check_as_left() {
  switch (file.look()) {
    case StoreFile::Finding::kAsLeft:
      return {};
    case StoreFile::Finding::kGone:
      leave_no_journal();
      return failure(ErrorCode::kBusy, "was removed or renamed while it is served from")
          .in(path)
          .next(fmt::format("put it back ({}), or start the service again to go on with the copies of its models",
                            file.how_to_bring_back()));
    case StoreFile::Finding::kAnother:
      leave_no_journal();
      break;
    case StoreFile::Finding::kTouched:
      database.reset();  // what it remembers of the file is no longer so
  }
  return check_state(path, mark_);
}

Status StoreConnection::check_in_place() {
  const auto finding = file.look();
  if (finding != StoreFile::Finding::kGone && finding != StoreFile::Finding::kAnother) return {};
  must_be_opened_anew_ = true;
  return open_anew().and_then([this]() -> Status {
    return failure(ErrorCode::kBusy, "was put back while it was written").in(path).next("ask again");
  });
}

void StoreConnection::leave_no_journal() {
  if (!database) return;
  try {
    database->exec("PRAGMA wal_checkpoint(TRUNCATE)");
  } catch (const SQLite::Exception&) {  // it has none that it may write
  }
}

StoreState StoreConnection::state() const {
  const MutexLock guard(state_mutex);
  return state_now;
}

void StoreConnection::note_trouble(const Error& why, bool unreadable) {
  {
    const MutexLock guard(state_mutex);
    if (!state_now.why_not_written) state_now.since = unix_now();
    state_now.why_not_written = why;
    state_now.readable = !unreadable;
    ++state_now.failed_writes;
  }
  state_changed.notify_all();
}

void StoreConnection::note_written() {
  {
    const MutexLock guard(state_mutex);
    if (!state_now.why_not_written) return;
    state_now.why_not_written.reset();
    state_now.readable = true;
    state_now.since = unix_now();
  }
  state_changed.notify_all();
}

void StoreConnection::note_damage(const std::string& what) {
  const MutexLock guard(state_mutex);
  auto& damages = state_now.damages;
  if (damages.size() < kMostDamages && std::find(damages.begin(), damages.end(), what) == damages.end())
    damages.push_back(what);
}

std::optional<std::chrono::seconds> StoreConnection::note_clock() {
  const MutexLock guard(state_mutex);
  const auto step = clock.look(ClockWatch::now());
  if (!step) return step;
  const auto off = clock.off();
  state_now.clock = off.count() == 0
                        ? ""
                        : fmt::format(
                              "the host's clock was set by {:+} s while the service ran: dates from before, or "
                              "since, are wrong (trammel audit says when)",
                              off.count());
  return step;
}

}  // namespace trammel
