#include "server/store/file_connection.h"

#include <exception>
#include <utility>

#include "server/base/unix_time.h"
#include "server/store/audit_rows.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kBetweenTries{1};  // between attempts to open a file that cannot be
                                                  // written

}  // namespace

FileConnection::FileConnection(WriterLock writer, StoreFile held, std::string name,
                               OpenedDatabase opened, std::unique_ptr<ServedCopies> kept)
    : StoreConnection(std::move(name), std::move(kept)),
      lock_(std::move(writer)),
      file_(std::move(held)),
      database_(std::move(opened.file)) {
  const MutexLock guard(mutex_);
  must_be_opened_anew_ = opened.why_not_written.has_value();
  if (must_be_opened_anew_) {
    note_trouble(*opened.why_not_written, database_ == nullptr);
  } else {
    note_opened();
  }
}

FileConnection::~FileConnection() {
  const MutexLock guard(mutex_);
  const auto finding = file_.look();
  if (finding == StoreFile::Finding::kGone || finding == StoreFile::Finding::kAnother)
    leave_no_journal();
}

void FileConnection::note_opened() {
  was_written_ = true;
  mark_ = mark_of(*database_);
  file_.remember();
  const std::int64_t behind = last_audit_at(*database_) - unix_now();
  const MutexLock guard(state_mutex);
  if (behind >= ClockWatch::kNoticed.count() && state_now.clock.empty())
    state_now.clock = fmt::format(
        "the host's clock is {} s behind the last change in the store: one of the two is dated "
        "wrongly (trammel audit shows them)",
        behind);
}

Result<std::unique_ptr<StoreConnection>> FileConnection::open(const std::string& path) {
  auto lock = TRY(WriterLock::take(path));
  auto copies = std::make_unique<ServedCopies>(path + ".models");
  StoreFile file(path);
  TRY(file.hold());
  auto opened = TRY(open_database(path, *copies));
  if (auto held = file.hold(); !held)
    return tl::make_unexpected(held.error());  // there was no file before
  return std::make_unique<FileConnection>(std::move(lock), std::move(file), path, std::move(opened),
                                          std::move(copies));
}

Status FileConnection::read(const Job& job) {
  const MutexLock guard(mutex_);
  if (!database_) return tl::make_unexpected(*state().why_not_written);
  try {
    return job(*database_);
  } catch (const DatabaseError& error) {
    return failure_of(error, path).as(ErrorCode::kInternal);
  } catch (const std::exception& error) {
    return failure(ErrorCode::kInternal, "{}", error.what()).in(path);
  }
}

Status FileConnection::write(const Job& job) {
  const MutexLock guard(mutex_);
  TRY(be_sure_of_file());
  bool changed = false;
  Status result = transacted(job, &changed);
  file_.remember();
  if (!result || !changed) return result;
  TRY(check_in_place());
  note_written();
  return result;
}

Status FileConnection::transacted(const Job& job, bool* changed) {
  try {
    Transaction transaction(*database_, Transaction::For::kWriting);
    const int changes = database_->total_changes();
    TRY(job(*database_));
    transaction.do_last();
    *changed = database_->total_changes() != changes;
    auto mark = *changed ? mark_of(*database_) : mark_;
    transaction.commit();
    mark_ = std::move(mark);
    return {};
  } catch (const DatabaseError& error) {
    Failure said = failure_of(error, path);
    if (error.kind() == DatabaseError::Kind::kAway) note_trouble(said.value(), false);
    return said;
  } catch (const std::exception& error) {
    return failure(ErrorCode::kInternal, "{}", error.what()).in(path);
  }
}

Status FileConnection::try_again() {
  if (is_in_order()) return {};
  return write([](Database& database) -> Status {
    // SQLite writes nothing for an update without changes.
    change(database, "INSERT INTO store_identity (id) VALUES ('')");
    change(database, "DELETE FROM store_identity WHERE id = ''");
    return {};
  });
}

bool FileConnection::is_in_order() {
  const MutexLock guard(mutex_);
  return !must_be_opened_anew_ && !state().why_not_written &&
         file_.look() == StoreFile::Finding::kAsLeft;
}

Status FileConnection::be_sure_of_file() {
  if (!must_be_opened_anew_) {
    if (file_.look() == StoreFile::Finding::kAsLeft) return {};
    must_be_opened_anew_ = true;
    tried_last_ = {};
  }
  const auto now = std::chrono::steady_clock::now();
  if (const auto why = state().why_not_written; why && now < tried_last_ + kBetweenTries)
    return tl::make_unexpected(*why);
  tried_last_ = now;
  return open_anew();
}

Status FileConnection::open_anew() {
  const Status as_left = was_written_ ? check_as_left() : Status();
  Status opened = as_left ? opened_anew() : as_left;
  if (!opened) {
    // The service was well before, so callers try again; see failure_of().
    if (was_written_)
      opened = tl::make_unexpected(Failure(opened.error()).as(ErrorCode::kBusy).value());
    note_trouble(opened.error(), database_ == nullptr);
  }
  return opened;
}

Status FileConnection::opened_anew() {
  database_.reset();  // one connection at a time: its locks are the process's
  TRY(file_.hold());
  auto opened = TRY(open_database(path, *copies));
  database_ = std::move(opened.file);
  if (opened.why_not_written) return tl::make_unexpected(*opened.why_not_written);
  TRY(file_.hold());
  note_opened();
  must_be_opened_anew_ = false;
  return {};
}

Status FileConnection::check_as_left() {
  switch (file_.look()) {
    case StoreFile::Finding::kAsLeft:
      return {};
    case StoreFile::Finding::kGone:
      leave_no_journal();
      return failure(ErrorCode::kBusy, "was removed or renamed while it is served from")
          .in(path)
          .next(fmt::format(
              "put it back ({}), or start the service again to go on with the copies of its models",
              file_.how_to_bring_back()));
    case StoreFile::Finding::kAnother:
      leave_no_journal();
      break;
    case StoreFile::Finding::kTouched:
      database_.reset();  // its cached view of the file is out of date
  }
  return check_state(path, mark_);
}

Status FileConnection::check_in_place() {
  const auto finding = file_.look();
  if (finding != StoreFile::Finding::kGone && finding != StoreFile::Finding::kAnother) return {};
  must_be_opened_anew_ = true;
  return open_anew().and_then([this]() -> Status {
    return failure(ErrorCode::kBusy, "was put back while it was written")
        .in(path)
        .next("ask again");
  });
}

void FileConnection::leave_no_journal() {
  if (!database_) return;
  try {
    database_->execute("PRAGMA wal_checkpoint(TRUNCATE)");
  } catch (const DatabaseError&) {  // it may not write any
  }
}

void FileConnection::wait_for_change(const std::stop_token& stop, std::chrono::milliseconds limit) {
  wait_without_word(stop, std::chrono::steady_clock::now() + limit);
}

}  // namespace trammel
