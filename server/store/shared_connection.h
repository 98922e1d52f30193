#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "server/store/connection.h"
#include "server/store/database/postgres_database.h"

namespace trammel {

/// A database that several servers share. While it is away everything is refused at once; it is
/// tried again by try_again() alone. What is served meanwhile are the copies.
class SharedConnection final : public StoreConnection {
 public:
  /// A database that does not answer is away. Refuses what Store::open() refuses.
  [[nodiscard]] static Result<std::unique_ptr<StoreConnection>> open(const std::string& url,
                                                                     const std::string& cache);

  [[nodiscard]] bool is_shared() const override { return true; }
  [[nodiscard]] Status try_again() override;
  void wait_for_change(const std::stop_token& stop, std::chrono::milliseconds limit) override;

 private:
  using Connected = std::unique_ptr<PostgresDatabase>;
  using Clock = std::chrono::steady_clock;

  SharedConnection(std::string url, std::unique_ptr<ServedCopies> kept);
  [[nodiscard]] Status read(const Job& job) override;
  [[nodiscard]] Status write(const Job& job) override;
  [[nodiscard]] Status write_urgently(const Job& job) override;
  /// In one transaction, again where others were in the way. `most`: connections that may be in use
  /// with this one.
  [[nodiscard]] Status run(const Job& job, Transaction::For what, std::size_t most);

  /// Checks that the database is the store that served here before, of a schema that this program
  /// knows.
  [[nodiscard]] Status admit(Database& database);
  [[nodiscard]] Result<Connected> connect();
  /// One that nobody uses, or a new one.
  [[nodiscard]] Result<Connected> borrow(std::size_t most);
  void give_back(Connected connected);
  /// True if the word of a change came. Connects where needed: what changed before that is not
  /// told.
  [[nodiscard]] bool hears_of_change(const std::stop_token& stop, Clock::time_point until);

  const std::string url_;  // may hold a password
  Mutex mutex_;
  Condition given_back_;
  std::string identity_ TRAMMEL_GUARDED_BY(mutex_);  // of the store; empty: not known yet
  std::vector<Connected> idle_ TRAMMEL_GUARDED_BY(mutex_);
  std::size_t lent_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  Connected listener_;  // of the one thread that waits for changes
  std::atomic<bool> listener_may_be_lost_ = false;
};

}  // namespace trammel
