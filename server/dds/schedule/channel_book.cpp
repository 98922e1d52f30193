#include "server/dds/schedule/channel_book.h"

#include <algorithm>
#include <utility>

namespace trammel {
namespace {

constexpr std::size_t kMostKnown = 4096;  // clients; more are heard when some have left
constexpr int kPartitionsOfOne = 4;       // a participant may be as many clients
constexpr std::size_t kMostBeside = 64;   // readers of others in a client's partition
/// A channel also costs all other clients something. A participant may use so many names at once,
/// and one more in each period.
constexpr int kNamesAtOnce = 8;
constexpr std::chrono::milliseconds kPeriodOfName{500};
constexpr std::size_t kOpenedAtOnce = 16;  // so that clients with a channel are not held up
/// The longest penalty, per present client, since all of them are notified of a change. With few
/// clients it is short, since some clients send nothing before they are matched.
constexpr std::chrono::milliseconds kPenaltyOfEach{100};
constexpr std::chrono::milliseconds kLongestAmongFew{12'000}, kLongestAmongMany{30'000};

}  // namespace

void ChannelBook::found(const ReplyReader& reader, SteadyTime now) {
  const auto known = clients_.find(reader.partition);
  if (known != clients_.end()) {
    return found_beside(reader, &known->second);
  }
  if (clients_.size() >= kMostKnown) return;
  if (listeners_.size() >= kMostKnown) forget_listeners(now);
  Listener& listener = listeners_[reader.participant];
  if (listener.partitions >= kPartitionsOfOne) return;
  ++listener.partitions;
  listener.next_free = std::max(listener.next_free, now) + kPeriodOfName;
  Client& client = clients_[reader.partition];
  client.participant = reader.participant;
  client.topics.insert(reader.topic);
  client.not_before = std::max(now, listener.next_free - kNamesAtOnce * kPeriodOfName);
  client.waits_since = client.not_before;
}

void ChannelBook::found_beside(const ReplyReader& reader, Client* client) {
  if (client->participant == reader.participant) {
    client->topics.insert(reader.topic);
  } else if (client->others.size() < kMostBeside) {
    client->others.push_back(reader);
  }
}

void ChannelBook::lost(const ReplyReader& reader) {
  const auto known = clients_.find(reader.partition);
  if (known == clients_.end()) return;
  std::erase(known->second.others, reader);
  if (known->second.participant != reader.participant) return;
  known->second.topics.erase(reader.topic);
  if (known->second.topics.empty()) drop(known);
}

void ChannelBook::left(const std::string& participant) {
  for (auto client = clients_.begin(); client != clients_.end();) {
    const auto next = std::next(client);
    std::erase_if(client->second.others,
                  [&](const ReplyReader& one) { return one.participant == participant; });
    if (client->second.participant == participant) drop(client);
    client = next;
  }
}

void ChannelBook::drop(Clients::iterator client) {
  if (client->second.is_open) {
    closings_.push_back({Change::Kind::kClose, client->first, {}});
    --open_;
  }
  --listeners_[client->second.participant].partitions;
  const std::vector<ReplyReader> others = std::move(client->second.others);
  const SteadyTime now = client->second.last_used;
  clients_.erase(client);
  for (const ReplyReader& reader : others) found(reader, now);
}

void ChannelBook::forget_listeners(SteadyTime now) {
  std::erase_if(listeners_, [now](const auto& entry) {
    return entry.second.partitions == 0 && entry.second.next_free <= now;
  });
}

bool ChannelBook::may_listen(const std::string& participant, const std::string& partition) const {
  const auto known = clients_.find(partition);
  return known == clients_.end() || known->second.participant == participant;
}

bool ChannelBook::listens(const std::string& participant, const std::string& partition) const {
  const auto known = clients_.find(partition);
  return known != clients_.end() && known->second.participant == participant;
}

bool ChannelBook::asked(const std::string& partition, SteadyTime now) {
  const auto known = clients_.find(partition);
  if (known == clients_.end()) return false;
  Client& client = known->second;
  ++client.at_work;
  client.last_used = now;
  client.was_useful = true;
  if (client.is_open || client.asks) return false;
  client.asks = true;
  client.waits_since = std::max(client.not_before, std::min(client.waits_since, now));
  return true;
}

void ChannelBook::answered(const std::string& partition, SteadyTime now) {
  const auto known = clients_.find(partition);
  if (known == clients_.end()) return;
  if (known->second.at_work > 0) --known->second.at_work;
  known->second.last_used = now;
}

/// Asking clients come before clients that only listen.
ChannelBook::Clients::iterator ChannelBook::first_waiting(SteadyTime now) {
  auto first = clients_.end();
  for (auto client = clients_.begin(); client != clients_.end(); ++client) {
    if (client->second.is_open || client->second.waits_since > now) continue;
    const auto rank = [](const Client& one) { return std::pair(!one.asks, one.waits_since); };
    if (first == clients_.end() || rank(client->second) < rank(first->second)) first = client;
  }
  return first;
}

ChannelBook::Clients::iterator ChannelBook::least_useful(SteadyTime now) {
  auto least = clients_.end();
  for (auto client = clients_.begin(); client != clients_.end(); ++client) {
    const Client& one = client->second;
    if (!one.is_open || one.at_work > 0 || now - one.last_used < grace_) continue;
    if (least == clients_.end() || one.last_used < least->second.last_used) least = client;
  }
  return least;
}

void ChannelBook::open(Client& client, SteadyTime now) {
  client.is_open = true;
  client.was_useful = client.asks;
  client.asks = false;
  client.last_used = now;
  ++open_;
}

void ChannelBook::close(Clients::iterator client, SteadyTime now, std::vector<Change>* changes) {
  changes->push_back({Change::Kind::kClose, client->first, {}});
  Client& one = client->second;
  one.is_open = false;
  one.opened.clear();
  const auto longest = std::clamp(static_cast<int>(clients_.size()) * kPenaltyOfEach,
                                  kLongestAmongFew, kLongestAmongMany);
  one.penalty = one.was_useful
                    ? SteadyTime::duration(0)
                    : std::min<SteadyTime::duration>(std::max(2 * one.penalty, grace_), longest);
  one.waits_since = now + one.penalty;
  --open_;
}

std::vector<ChannelBook::Change> ChannelBook::changes(SteadyTime now) {
  std::vector<Change> changes = std::exchange(closings_, {});
  for (std::size_t i = 0; i < kOpenedAtOnce; ++i) {
    const auto newcomer = first_waiting(now);
    if (newcomer == clients_.end()) break;
    if (open_ >= capacity_) {
      const auto least = least_useful(now);
      if (least == clients_.end()) break;
      close(least, now, &changes);
    }
    open(newcomer->second, now);
  }
  for (auto& [partition, client] : clients_) {
    if (!client.is_open) continue;
    for (const std::string& topic : client.topics) {
      if (client.opened.insert(topic).second)
        changes.push_back({Change::Kind::kOpen, partition, topic, client.participant});
    }
  }
  return changes;
}

}  // namespace trammel
