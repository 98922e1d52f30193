#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <type_traits>
#include <utility>

#include "server/base/mutex.h"
#include "server/base/result.h"
#include "server/store/claim_rows.h"
#include "server/store/clock_watch.h"
#include "server/store/database/database.h"
#include "server/store/served_copies.h"
#include "server/store/statements.h"
#include "server/store/store_state.h"

namespace trammel {

/// The access of a store to its database, and the known state of the database. Thread-safe.
class StoreConnection {
 public:
  StoreConnection(std::string place, std::unique_ptr<ServedCopies> kept)
      : path(std::move(place)), copies(std::move(kept)) {}
  virtual ~StoreConnection() = default;
  StoreConnection(const StoreConnection&) = delete;
  StoreConnection& operator=(const StoreConnection&) = delete;

  /// Runs `work(database)`, which reads one consistent state. An exception of the database becomes
  /// an error.
  template <typename Work>
  std::invoke_result_t<const Work&, Database&> exclusively(const Work& work) {
    return through([this](const Job& job) { return read(job); }, work);
  }
  /// Runs `work(database)` in one transaction, committed only if `work` succeeds. If several
  /// servers write, `work` may run more than once, and only its last run counts.
  template <typename Work>
  std::invoke_result_t<const Work&, Database&> in_transaction(const Work& work) {
    return through([this](const Job& job) { return write(job); }, work);
  }

  /// in_transaction() for work that must not queue behind other work of this server: a heartbeat.
  template <typename Work>
  std::invoke_result_t<const Work&, Database&> urgently(const Work& work) {
    return through([this](const Job& job) { return write_urgently(job); }, work);
  }

  /// True if several servers write it. Then the database decides, whatever the copies have.
  [[nodiscard]] virtual bool is_shared() const = 0;
  /// If the database could not be written or has changed, tests whether it can be written now.
  [[nodiscard]] virtual Status try_again() = 0;
  /// Returns when another server may have changed something, after `limit` at the latest, or when
  /// `stop` is requested. For one thread.
  virtual void wait_for_change(const std::stop_token& stop, std::chrono::milliseconds limit) = 0;
  /// See Store::will_end().
  virtual void will_end() {}

  [[nodiscard]] StoreState state() const;
  /// Records the trouble, and wakes the threads that wait for a change of the state.
  void note_trouble(const Error& why, bool unreadable);
  void note_written();
  /// Damage that was found. It is reported once.
  void note_damage(const std::string& what);
  /// The change of the host's clock since the last call; empty: none.
  [[nodiscard]] std::optional<std::chrono::seconds> note_clock();

  const std::string path;  ///< a file, or a URL in its form for people
  const std::unique_ptr<ServedCopies> copies;
  Worker worker = new_worker();  ///< its name is set before there are jobs
  std::string told_cells;  ///< the cells in the last heartbeat; only the heartbeat's thread uses it
  bool has_told = false;   ///< a heartbeat was sent; only the heartbeat's thread uses it
  mutable Mutex state_mutex;  // taken last, and for moments only
  Condition state_changed;
  StoreState state_now TRAMMEL_GUARDED_BY(state_mutex);
  ClockWatch clock TRAMMEL_GUARDED_BY(state_mutex){ClockWatch::now()};

 protected:
  /// The time passes.
  static void wait_without_word(const std::stop_token& stop,
                                std::chrono::steady_clock::time_point until);
  using Job = std::function<Status(Database&)>;

 private:
  [[nodiscard]] virtual Status read(const Job& job) = 0;
  [[nodiscard]] virtual Status write(const Job& job) = 0;
  [[nodiscard]] virtual Status write_urgently(const Job& job) { return write(job); }

  template <typename Way, typename Work>
  static std::invoke_result_t<const Work&, Database&> through(const Way& way, const Work& work) {
    std::optional<std::invoke_result_t<const Work&, Database&>> made;
    const Status done = way([&](Database& database) -> Status {
      made.emplace(work(database));
      if (!*made) return tl::make_unexpected(made->error());
      return {};
    });
    if (!done) return tl::make_unexpected(done.error());
    return std::move(*made);
  }
};

}  // namespace trammel
