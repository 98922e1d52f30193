#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <stop_token>
#include <string>
#include <vector>

#include "clients/session/session.h"
#include "server/robot/cell.h"
#include "tests/support/history.h"

namespace trammel::test {

/// The cells that the clients of a fleet use.
struct AskedCell {
  std::string name;
  std::shared_ptr<const Cell> small;  ///< null: the shipped virtual cell
};

/// The batches submitted by all clients. Thread-safe.
class SharedBatches {
 public:
  explicit SharedBatches(int most) : most_(most) {}

  struct Batch {
    std::string id;
    std::uint64_t seed = 0;
  };
  /// A new batch of the cell; empty: the cell has its maximum.
  [[nodiscard]] std::optional<Batch> next(const std::string& cell);
  /// A random existing batch.
  [[nodiscard]] std::optional<Batch> any(const std::string& cell, std::mt19937_64& random) const;

 private:
  const int most_;  // of a cell
  mutable std::mutex mutex_;
  std::map<std::string, std::vector<Batch>> batches_;
};

/// The text of that batch; one in seven has two columns exchanged, and is quarantined.
[[nodiscard]] std::string text_of(const AskedCell& cell, std::uint64_t seed);

/// Sends one request after the other, all kinds of changes and reads of all cells, and records
/// each. A change without an answer is repeated under its id, to this server or another, until it
/// is answered.
class FleetClient {
 public:
  FleetClient(int number, const client::SessionOptions& first, const client::SessionOptions& other,
              const std::vector<AskedCell>& cells, SharedBatches& batches, History& history,
              std::uint64_t seed);

  void work(const std::stop_token& stop);
  void read_models(const std::string& cell);

 private:
  struct Seen {
    int in_force = 0, newest = 0;
  };
  enum class Server { kFirst, kOther };

  void one(const AskedCell& cell);
  void submit(const AskedCell& cell);
  void submit_again(const AskedCell& cell);
  void activate(const AskedCell& cell);
  void rollback(const AskedCell& cell);
  void train(const AskedCell& cell);
  void keep_out(const AskedCell& cell, bool for_ever);
  void read_batch(const AskedCell& cell);

  void send_batch(const AskedCell& cell, const SharedBatches::Batch& batch,
                  const std::string& text);
  /// Asks `call(session, options)` until it is answered, and now and then once more.
  template <typename Call>
  void change(nlohmann::json record, const Call& call);
  [[nodiscard]] nlohmann::json record_of(const char* operation, const std::string& cell) const;
  [[nodiscard]] bool by_chance(double share);
  [[nodiscard]] client::Session& session(Server which) {
    return which == Server::kFirst ? *first_ : *other_;
  }
  [[nodiscard]] static std::unique_ptr<client::Session> opened(
      const client::SessionOptions& options);

  const int number_;
  const std::unique_ptr<client::Session> first_, other_;
  const std::vector<AskedCell>& cells_;
  SharedBatches& batches_;
  History& history_;
  std::mt19937_64 random_;
  std::map<std::string, Seen> seen_;
  int changes_ = 0;
};

}  // namespace trammel::test
