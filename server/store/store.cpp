#include "server/store/store.h"

#include <chrono>
#include <memory>
#include <utility>

#include "server/base/unix_time.h"
#include "server/store/audit_rows.h"
#include "server/store/connection.h"
#include "server/store/store_file.h"

namespace trammel {

Store::Store(std::unique_ptr<StoreConnection> connection) : connection_(std::move(connection)) {}
Store::~Store() = default;

Result<std::unique_ptr<Store>> Store::open(const std::string& path) {
  auto lock = WriterLock::take(path);
  if (!lock) return tl::make_unexpected(lock.error());
  auto copies = std::make_unique<ServedCopies>(path);
  StoreFile file(path);
  if (auto held = file.hold(); !held) return tl::make_unexpected(held.error());
  auto opened = open_database(path, *copies);
  if (!opened) return tl::make_unexpected(opened.error());
  if (auto held = file.hold(); !held) return tl::make_unexpected(held.error());  // where it was not there before
  return std::unique_ptr<Store>(new Store(std::make_unique<StoreConnection>(std::move(*lock), std::move(file), path,
                                                                            std::move(*opened), std::move(copies))));
}

StoreState Store::state() const { return connection_->state(); }

namespace {

/// A clock that was set stands in the trail, between what was dated by it before and after. Where that cannot be
/// written, the state says so all the same.
void look_at_clock(StoreConnection& connection) {
  const auto step = connection.note_clock();
  if (!step) return;
  static_cast<void>(connection.in_transaction([&step](SQLite::Database& database) -> Status {
    const std::int64_t now = unix_now();
    record_audit(database, {"", "clock", "clock", fmt::format("{} s since 1970", now - step->count()),
                            fmt::format("{} s since 1970", now), fmt::format("set by {:+} s", step->count())});
    return {};
  }));
}

}  // namespace

Status Store::try_again() {
  look_at_clock(*connection_);
  if (connection_->is_in_order()) return {};
  return connection_->in_transaction([](SQLite::Database& database) -> Status {
    // Of an update that changes nothing SQLite writes nothing.
    change(database, "INSERT INTO store_identity (id) VALUES ('')");
    change(database, "DELETE FROM store_identity WHERE id = ''");
    return {};
  });
}

bool Store::wait_until_writable(const std::stop_token& stop) {
  constexpr std::chrono::seconds kTick{1};
  StoreConnection& connection = *connection_;
  while (!stop.stop_requested()) {
    if (try_again()) return true;
    MutexLock guard(connection.state_mutex);
    connection.state_changed.wait_for(guard, stop, kTick, [&connection]() TRAMMEL_REQUIRES(connection.state_mutex) {
      return !connection.state_now.why_not_written;
    });
  }
  return false;
}

}  // namespace trammel
