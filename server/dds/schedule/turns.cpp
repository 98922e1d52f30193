#include "server/dds/schedule/turns.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace trammel {
namespace {

constexpr std::size_t kClientsRemembered = 1024;  // with nothing to do
constexpr std::chrono::milliseconds kSoonest{20};
constexpr std::chrono::milliseconds kLatest{5000};

std::chrono::milliseconds as_retry(Cost wait) {
  const auto rounded = std::chrono::ceil<std::chrono::milliseconds>(std::min<Cost>(wait, kLatest));
  return std::clamp(rounded, kSoonest, kLatest);
}

}  // namespace

void Turns::set_limits(const TurnLimits& limits) {
  limits_.client_requests = limits.client_requests;
  limits_.requests = limits.requests;
  limits_.cell_share = limits.cell_share;
}

std::size_t Turns::Entry::claim(std::size_t most, std::size_t* first) {
  if (next_.load() >= items_) return 0;
  *first = next_.fetch_add(most);
  return *first >= items_ ? 0 : std::min(most, items_ - *first);
}

std::optional<Shed> Turns::add(std::shared_ptr<Job> job, Ask ask, Room::Place place,
                               SteadyTime now) {
  const Cost own = costs_.per_item(ask.work, now) * static_cast<double>(ask.items);
  Client& client = arrived(ask.client);
  if (auto why = refusal(client, ask, own, now)) return why;
  if (!ask.cell.empty()) ++cells_[ask.cell].requests;
  ++requests_;
  client.backlog += own;
  client.entries.push_back(
      std::make_shared<Entry>(std::move(job), std::move(ask), std::move(place), own));
  return std::nullopt;
}

Turns::Client& Turns::arrived(const std::string& name) {
  if (clients_.size() >= kClientsRemembered) forget_clients();
  Client& client = clients_[name];
  if (client.entries.empty()) client.had = std::max(client.had, level_);
  return client;
}

/// A client that had more time than the others stays known: it must not return as a new one.
void Turns::forget_clients() {
  std::erase_if(clients_, [this](const auto& known) {
    return known.second.entries.empty() && known.second.running == 0 && known.second.had <= level_;
  });
}

std::optional<Shed> Turns::refusal(const Client& client, const Ask& ask, Cost own,
                                   SteadyTime now) const {
  const auto full = [&](const std::string& why) {
    return Shed{why, retry_after(ask.client), false};
  };
  if (client.entries.size() >= limits_.client_requests) {
    return full(fmt::format("{} requests of this client wait", client.entries.size()));
  }
  if (requests_ >= limits_.requests) return full(fmt::format("{} requests wait", requests_));
  const auto cell = cells_.find(ask.cell);
  const auto cell_limit = std::max<std::size_t>(
      1, static_cast<std::size_t>(limits_.cell_share * static_cast<double>(limits_.requests)));
  if (cell != cells_.end() && cell->second.requests >= cell_limit) {
    return full(fmt::format("{} requests of this cell wait", cell->second.requests));
  }
  const Cost begins = served_in(client, Cost(0), 1);
  const Cost ends = served_in(client, own, ask.items);
  const Cost late = std::max(ask.finish_by ? ends - Cost(*ask.finish_by - now) : Cost(0),  //
                             begins - Cost(ask.start_by - now));
  if (late <= Cost(0)) return std::nullopt;
  return Shed{fmt::format("its {} items would be done in {:.0f} ms, too late", ask.items,
                          1e3 * ends.count()),
              as_retry(late), false};
}

Cost Turns::served_in(const Client& client, Cost own, std::size_t items) const {
  const Cost mine = client.backlog + own;
  Cost all = mine;
  for (const auto& [name, other] : clients_) {
    if (&other != &client) all += std::min(other.backlog, mine);
  }
  const std::size_t together = std::max<std::size_t>(1, std::min(items, limits_.workers));
  return std::max(all / static_cast<double>(limits_.workers), own / static_cast<double>(together));
}

std::chrono::milliseconds Turns::retry_after(const std::string& name) const {
  const auto client = clients_.find(name);
  if (client == clients_.end() || client->second.entries.empty()) return kSoonest;
  const Cost all = served_in(client->second, Cost(0), 1);
  return as_retry(all / static_cast<double>(client->second.entries.size()));
}

bool Turns::may_run(const Entry& entry) const {
  const auto cell = cells_.find(entry.ask_.cell);
  if (cell != cells_.end() && cell->second.running >= limits_.cell_workers) return false;
  if (entry.state_ == Entry::State::kWaits) return true;
  return entry.state_ == Entry::State::kOpen && !entry.given_up_ && entry.next_ < entry.items_;
}

bool Turns::is_short(const Entry& entry) const {
  constexpr std::size_t kFew = 4;  // items, of unknown cost
  return entry.state_ == Entry::State::kWaits && entry.left_ <= limits_.portion &&
         (entry.left_ > Cost(0) || entry.ask_.items <= kFew);
}

std::shared_ptr<Turns::Entry> Turns::workable(const Client& client, Which which) const {
  if (client.running >= limits_.client_workers) return nullptr;
  const auto found =
      std::find_if(client.entries.begin(), client.entries.end(), [&](const auto& entry) {
        return may_run(*entry) && (which == Which::kAll || is_short(*entry));
      });
  return found == client.entries.end() ? nullptr : *found;
}

std::optional<Turns::Portion> Turns::next(SteadyTime now, Which which) {
  Client* best = nullptr;
  std::shared_ptr<Entry> entry;
  for (auto& [name, client] : clients_) {
    if (best != nullptr && std::pair(client.had, client.turn) >= std::pair(best->had, best->turn))
      continue;
    if (auto work = workable(client, which)) {
      best = &client;
      entry = std::move(work);
    }
  }
  if (best == nullptr) return std::nullopt;
  return hand_out(*best, std::move(entry), now);
}

bool Turns::has_work() const {
  return std::any_of(clients_.begin(), clients_.end(), [this](const auto& one) {
    return workable(one.second, Which::kAll) != nullptr;
  });
}

std::optional<Turns::Portion> Turns::next_late(SteadyTime now) {
  for (auto& [name, client] : clients_) {
    for (const auto& entry : client.entries) {
      if (entry->running_ > 0) continue;
      auto late = too_late(client, *entry, now);
      if (!late) continue;
      const std::shared_ptr<Entry> taken = entry;
      remove(client, *taken);
      return Portion{taken, Part::kShed, std::move(*late)};
    }
  }
  return std::nullopt;
}

Turns::Portion Turns::hand_out(Client& client, std::shared_ptr<Entry> entry, SteadyTime now) {
  if (auto late = too_late(client, *entry, now)) {
    entry->given_up_ = true;  // if other portions are under way, this one is its last
    if (entry->running_ == 0) {
      remove(client, *entry);
      return {std::move(entry), Part::kShed, std::move(*late)};
    }
  }
  const Part part = entry->state_ == Entry::State::kWaits ? Part::kBegin : Part::kCompute;
  if (part == Part::kBegin) entry->state_ = Entry::State::kBegins;
  ++entry->running_;
  ++client.running;
  if (!entry->ask_.cell.empty()) ++cells_[entry->ask_.cell].running;
  level_ = std::max(level_, client.had);
  client.had += limits_.portion.count();  // until it is known
  client.turn = ++turns_;
  return {std::move(entry), part};
}

std::optional<Shed> Turns::too_late(const Client& client, const Entry& entry,
                                    SteadyTime now) const {
  const Ask& ask = entry.ask_;
  const bool begun = entry.state_ != Entry::State::kWaits;
  const SteadyTime limit = ask.finish_by ? *ask.finish_by : ask.start_by;
  if (begun && (!ask.finish_by || now <= limit)) return std::nullopt;
  const Cost together(entry.left_ / static_cast<double>(std::max<std::size_t>(
                                        1, std::min(ask.items, limits_.workers))));
  const Cost late = Cost(now - limit) + (ask.finish_by && !begun ? together : Cost(0));
  if (late <= Cost(0)) return std::nullopt;
  return Shed{fmt::format("its {} items were not done in time", ask.items),
              as_retry(served_in(client, Cost(0), 1)), ask.finish_by && now > limit};
}

void Turns::open(Entry& entry, std::size_t items) {
  entry.items_ = items;
  entry.state_ = Entry::State::kOpen;
}

bool Turns::settle(const Portion& portion, const Done& done, SteadyTime now) {
  Entry& entry = *portion.entry;
  const Ask& ask = entry.ask_;
  Client& client = clients_.at(ask.client);
  --entry.running_;
  --client.running;
  if (!ask.cell.empty()) --cells_.at(ask.cell).running;
  client.had += done.took.count() - limits_.portion.count();
  costs_.measured(ask.work, done.items, done.computing, now);
  if (done.answered) entry.state_ = Entry::State::kOver;
  const bool sheds = entry.given_up_ && entry.state_ != Entry::State::kOver && entry.running_ == 0;
  if (done.answered || sheds) {
    remove(client, entry);
    return sheds;
  }
  if (entry.state_ == Entry::State::kOver) return false;  // another worker has answered
  const Cost left =
      costs_.per_item(ask.work, now) * static_cast<double>(entry.items_ - entry.computed_);
  client.backlog += left - entry.left_;
  entry.left_ = left;
  return false;
}

/// Portions of other workers may still be under way; these workers find the request removed.
void Turns::remove(Client& client, Entry& entry) {
  entry.state_ = Entry::State::kOver;
  client.backlog -= entry.left_;
  std::erase_if(client.entries, [&](const auto& one) { return one.get() == &entry; });
  if (client.entries.empty()) client.backlog = Cost(0);
  --requests_;
  if (!entry.ask_.cell.empty()) --cells_.at(entry.ask_.cell).requests;
}

std::deque<std::shared_ptr<Turns::Entry>> Turns::clear() {
  std::deque<std::shared_ptr<Entry>> idle;
  for (auto& [name, client] : clients_) {
    for (const auto& entry : client.entries) {
      if (entry->running_ == 0) idle.push_back(entry);
    }
  }
  for (const auto& entry : idle) remove(clients_.at(entry->ask_.client), *entry);
  return idle;
}

}  // namespace trammel
