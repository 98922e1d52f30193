#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "clients/session/session.h"

namespace trammel::test {

/// Clients that submit batches and alternately put versions 1 and 2 of cell-7 in force, each change
/// under an id of its own until it is acknowledged. They record what happened, and when.
class ChangeLoad {
 public:
  using Clock = std::chrono::steady_clock;

  ChangeLoad(const client::SessionOptions& servers, int clients);
  ~ChangeLoad() { stop(); }
  ChangeLoad(const ChangeLoad&) = delete;
  ChangeLoad& operator=(const ChangeLoad&) = delete;

  /// Until each client had a change acknowledged that it began since.
  [[nodiscard]] bool wait_for_everybody(std::chrono::seconds limit);
  void stop();

  [[nodiscard]] std::size_t acknowledged() const;
  /// From `since` on the longest time without an acknowledgement.
  [[nodiscard]] double longest_pause_s(Clock::time_point since) const;
  /// The ids of acknowledged changes that are not among these.
  [[nodiscard]] std::set<std::string> not_in(const std::set<std::string>& batches,
                                             const std::set<std::string>& changes) const;

 private:
  void work(const std::stop_token& stop, std::size_t client);
  [[nodiscard]] bool make(client::Session& session, std::size_t client, int number,
                          const std::string& csv);

  client::SessionOptions servers_;
  mutable std::mutex mutex_;  // guards the members below
  mutable std::condition_variable_any changed_;
  std::set<std::string> batches_, changes_;
  std::vector<Clock::time_point> when_;
  std::vector<Clock::time_point> last_begun_;  // for each client, the start of its last
                                               // acknowledged change
  std::vector<std::jthread> clients_;          // last: they use all the rest
};

}  // namespace trammel::test
