#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "server/store/connection.h"
#include "server/store/database/postgres_database.h"

namespace trammel {

/// A database that several servers share. While it is away, every call is refused at once, and only
/// try_again() connects again. Meanwhile the copies are served.
class SharedConnection final : public StoreConnection {
 public:
  /// A database that does not answer counts as away. Refuses the same as Store::open().
  [[nodiscard]] static Result<std::unique_ptr<StoreConnection>> open(const std::string& url,
                                                                     const std::string& cache);

  [[nodiscard]] bool is_shared() const override { return true; }
  [[nodiscard]] Status try_again() override;
  void wait_for_change(const std::stop_token& stop, std::chrono::milliseconds limit) override;
  void will_end() override { patience_->ends(); }

 private:
  using Connected = std::unique_ptr<PostgresDatabase>;
  using Clock = std::chrono::steady_clock;

  SharedConnection(std::string url, std::unique_ptr<ServedCopies> kept);
  [[nodiscard]] Status read(const Job& job) override;
  [[nodiscard]] Status write(const Job& job) override;
  [[nodiscard]] Status write_urgently(const Job& job) override;
  /// Runs the job in one transaction, and repeats it if others interfered. `most`: connections that
  /// may be in use together with this one.
  [[nodiscard]] Status run(const Job& job, Transaction::For what, std::size_t most);

  /// Checks that the database is the store that was served here before, with a schema that this
  /// program knows.
  [[nodiscard]] Status admit(Database& database);
  [[nodiscard]] Result<Connected> connect();
  /// One that nobody uses, or a new one.
  [[nodiscard]] Result<Connected> borrow(std::size_t most);
  void give_back(Connected connected);
  /// True if a notification of a change came. Connects if needed; changes before that are not
  /// reported.
  [[nodiscard]] bool hears_of_change(const std::stop_token& stop, Clock::time_point until);

  const std::string url_;  // may hold a password
  const std::shared_ptr<Patience> patience_ = std::make_shared<Patience>();
  Mutex mutex_;
  Condition given_back_;
  std::string identity_ TRAMMEL_GUARDED_BY(mutex_);  // of the store; empty: not known yet
  std::vector<Connected> idle_ TRAMMEL_GUARDED_BY(mutex_);
  std::size_t lent_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  Connected listener_;  // for the one thread that waits for changes
  std::atomic<bool> listener_may_be_lost_ = false;
};

}  // namespace trammel
