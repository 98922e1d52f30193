#include "tests/support/change_load.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "tests/support/demand.h"
#include "tests/support/virtual_cell.h"

namespace trammel::test {

ChangeLoad::ChangeLoad(const client::SessionOptions& servers, int clients)
    : servers_(servers), last_begun_(static_cast<std::size_t>(clients)) {
  for (std::size_t i = 0; i < last_begun_.size(); ++i)
    clients_.emplace_back([this, i](const std::stop_token& stop) { work(stop, i); });
}

bool ChangeLoad::make(client::Session& session, std::size_t client, int number,
                      const std::string& csv) {
  const std::string id = fmt::format("load-{}-{}", client, number);
  if (number % 2 == 0) return session.submit_measurements("cell-7", id, csv).has_value();
  client::ChangeOptions change;
  change.id = id;
  change.force = true;
  return session.activate("cell-7", 1 + number / 2 % 2, change).has_value();
}

void ChangeLoad::work(const std::stop_token& stop, std::size_t client) {
  constexpr std::chrono::milliseconds kBetween{20};
  const auto session = demand(client::Session::open(servers_));
  const std::string csv = virtual_batch_csv(12, client + 1);
  for (int number = 0; !stop.stop_requested();) {
    const auto begun = Clock::now();
    const bool made = make(*session, client, number, csv);
    std::unique_lock lock(mutex_);
    if (made) {
      (number % 2 == 0 ? batches_ : changes_).insert(fmt::format("load-{}-{}", client, number));
      when_.push_back(Clock::now());
      last_begun_.at(client) = begun;
      ++number;
      changed_.notify_all();
    }
    changed_.wait_for(lock, stop, kBetween, [] { return false; });
  }
}

bool ChangeLoad::wait_for_everybody(std::chrono::seconds limit) {
  const auto since = Clock::now();
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, limit, [&] {
    return std::all_of(last_begun_.begin(), last_begun_.end(),
                       [&](auto begun) { return begun >= since; });
  });
}

void ChangeLoad::stop() {
  for (std::jthread& client : clients_) client.request_stop();
  clients_.clear();
}

std::size_t ChangeLoad::acknowledged() const {
  const std::lock_guard lock(mutex_);
  return when_.size();
}

double ChangeLoad::longest_pause_s(Clock::time_point since) const {
  const std::lock_guard lock(mutex_);
  Clock::duration longest{0};
  Clock::time_point before = since;
  for (const Clock::time_point at : when_) {
    if (at <= since) continue;
    longest = std::max(longest, at - before);
    before = at;
  }
  return std::chrono::duration<double>(
             std::max(longest, before == since ? Clock::now() - since : longest))
      .count();
}

std::set<std::string> ChangeLoad::not_in(const std::set<std::string>& batches,
                                         const std::set<std::string>& changes) const {
  const std::lock_guard lock(mutex_);
  std::set<std::string> missing;
  for (const auto& [acknowledged, known] :
       {std::pair(&batches_, &batches), std::pair(&changes_, &changes)})
    std::set_difference(acknowledged->begin(), acknowledged->end(), known->begin(), known->end(),
                        std::inserter(missing, missing.end()));
  return missing;
}

}  // namespace trammel::test
