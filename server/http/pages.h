#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "server/base/mutex.h"
#include "server/http/exchange.h"
#include "server/http/watched.h"

namespace trammel {

/// The pages for people: the fleet, a cell, its models, jobs and their findings. Costly pages are
/// made one at a time, and the latest ones are cached for a moment. Thread-safe.
class Pages {
 public:
  explicit Pages(const Watched& server) : server_(server) {}

  [[nodiscard]] HttpReply answer(const HttpAsk& ask, ServerPhase phase);

 private:
  using Clock = std::chrono::steady_clock;
  struct Kept {
    std::string address;
    HttpReply reply;
    Clock::time_point until;
  };
  [[nodiscard]] HttpReply of_cell(const HttpAsk& ask);
  [[nodiscard]] HttpReply of_job(const HttpAsk& ask);
  /// The cached reply for this address, or a new one.
  [[nodiscard]] HttpReply kept(const std::string& address, std::chrono::seconds keep,
                               const std::function<HttpReply()>& make);
  [[nodiscard]] std::optional<HttpReply> find_kept(const std::string& address);

  const Watched& server_;
  Mutex making_;  // one costly page at a time
  Mutex mutex_;
  std::deque<Kept> kept_ TRAMMEL_GUARDED_BY(mutex_);  // newest first
};

}  // namespace trammel
