#include "server/store/store.h"

#include <chrono>
#include <memory>
#include <utility>

#include "server/base/unix_time.h"
#include "server/store/audit_rows.h"
#include "server/store/connection.h"
#include "server/store/file_connection.h"
#include "server/store/shared_connection.h"
#include "server/store/store_place.h"

namespace trammel {

Store::Store(std::unique_ptr<StoreConnection> connection) : connection_(std::move(connection)) {}
Store::~Store() = default;

Result<std::unique_ptr<Store>> Store::open(const std::string& place, const std::string& cache) {
  auto connection = TRY(is_postgres_url(place) ? SharedConnection::open(place, cache)
                                               : FileConnection::open(place));
  return std::unique_ptr<Store>(new Store(std::move(connection)));
}

StoreState Store::state() const { return connection_->state(); }

namespace {

/// Records a change of the clock in the trail, between the rows dated before and after it. If that
/// cannot be written, the state still reports it.
void look_at_clock(StoreConnection& connection) {
  const auto step = connection.note_clock();
  if (!step) return;
  static_cast<void>(connection.in_transaction([&step](Database& database) -> Status {
    const std::int64_t now = unix_now();
    record_audit(
        database,
        {"", "clock", "clock", fmt::format("{} s since 1970", now - step->count()),
         fmt::format("{} s since 1970", now), fmt::format("set by {:+} s", step->count())});
    return {};
  }));
}

}  // namespace

Status Store::try_again() {
  look_at_clock(*connection_);
  return connection_->try_again();
}

bool Store::wait_until_writable(const std::stop_token& stop) {
  constexpr std::chrono::seconds kTick{1};
  StoreConnection& connection = *connection_;
  while (!stop.stop_requested()) {
    if (try_again()) return true;
    MutexLock guard(connection.state_mutex);
    connection.state_changed.wait_for(guard, stop, kTick,
                                      [&connection]() TRAMMEL_REQUIRES(connection.state_mutex) {
                                        return !connection.state_now.why_not_written;
                                      });
  }
  return false;
}

}  // namespace trammel
