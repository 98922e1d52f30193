#include "idl/repairs/lost_leases.h"

#include <algorithm>
#include <ctime>
#include <functional>
#include <string_view>
#include <utility>

namespace trammel::wire {

LostLeases::Time LostLeases::now() {
  timespec time{};
  clock_gettime(CLOCK_BOOTTIME, &time);
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

std::size_t LostLeases::PrefixHash::operator()(const Prefix& prefix) const {
  return std::hash<std::string_view>()(
      {reinterpret_cast<const char*>(prefix.data()), prefix.size()});
}

LostLeases::Time LostLeases::closed_until(const Participant& who) const {
  return std::max(who.closed_until, lost_at(who) + lease_ + kLonger);
}

bool LostLeases::is_closed(const Participant& who, Time now) const {
  return now < who.closed_until || (lost_at(who) <= now && now < closed_until(who));
}

void LostLeases::awake(Time now) {
  const Time before{awake_.exchange(now.count())};
  // Our last announcement before the sleep may have been sent this long before it.
  constexpr std::chrono::milliseconds kPeriod{200};
  if (before == Time{} || now - before < lease_ - kMargin - kPeriod) return;
  const MutexLock lock(mutex_);
  for (auto& [prefix, who] : participants_)
    who.closed_until = std::max(now + lease_, who.heard + who.lease) + kLonger;
  all_open_until_ = 0;
}

bool LostLeases::lets_in(const Prefix& prefix, Time now) {
  const MutexLock lock(mutex_);
  const auto who = participants_.find(prefix);
  if (who == participants_.end()) return true;
  if (is_closed(who->second, now)) return false;
  who->second.heard = now;
  return true;
}

void LostLeases::announced(const Prefix& prefix, std::vector<std::uint64_t> sockets,
                           std::chrono::milliseconds lease, Time now) {
  const MutexLock lock(mutex_);
  if (!participants_.contains(prefix)) make_room(now);
  Participant& who = participants_[prefix];
  who.sockets = std::move(sockets);
  who.lease = lease;
  who.heard = now;
  all_open_until_ = std::min(all_open_until_.load(), lost_at(who).count());
}

void LostLeases::make_room(Time now) {
  std::erase_if(participants_,
                [&](const auto& entry) { return closed_until(entry.second) <= now; });
  if (participants_.size() < kMost) return;
  participants_.erase(std::min_element(
      participants_.begin(), participants_.end(),
      [](const auto& a, const auto& b) { return a.second.heard < b.second.heard; }));
}

void LostLeases::left(const Prefix& prefix) {
  const MutexLock lock(mutex_);
  participants_.erase(prefix);
}

std::vector<std::uint64_t> LostLeases::silent_sockets(Time now) {
  std::vector<std::uint64_t> silent;
  if (now.count() < all_open_until_) return silent;
  const MutexLock lock(mutex_);
  Time open_until = Time::max();
  for (const auto& [prefix, who] : participants_) {
    if (is_closed(who, now)) silent.insert(silent.end(), who.sockets.begin(), who.sockets.end());
    if (now < closed_until(who)) open_until = std::min(open_until, lost_at(who));
  }
  all_open_until_ = silent.empty() ? open_until.count() : 0;
  for (const auto& [prefix, who] : participants_) {  // a new one may listen where another one did
    if (is_closed(who, now) || lost_at(who) <= now) continue;
    for (const std::uint64_t socket : who.sockets) std::erase(silent, socket);
  }
  return silent;
}

}  // namespace trammel::wire
