#include "server/dds/schedule/outbox.h"

#include <iterator>
#include <utility>

namespace trammel {

bool Outbox::put(Parcel parcel) {
  const Held held = held_.contains(parcel.client) ? held_.at(parcel.client) : Held{};
  if (held.replies >= limits_.client_replies || held.bytes + parcel.bytes > limits_.client_bytes)
    return false;
  if (bytes_ + parcel.bytes > limits_.bytes) return false;
  held_[parcel.client] = {held.replies + 1, held.bytes + parcel.bytes};
  ++listens_[parcel.partition];
  bytes_ += parcel.bytes;
  parcels_.push_back(std::move(parcel));
  return true;
}

std::list<Parcel>::iterator Outbox::remove(std::list<Parcel>::iterator parcel,
                                           std::list<Parcel>* to) {
  const auto held = held_.find(parcel->client);
  held->second.bytes -= parcel->bytes;
  if (--held->second.replies == 0) held_.erase(held);
  const auto listens = listens_.find(parcel->partition);
  if (--listens->second == 0) listens_.erase(listens);
  bytes_ -= parcel->bytes;
  const auto next = std::next(parcel);
  to->splice(to->end(), parcels_, parcel);
  return next;
}

std::list<Parcel> Outbox::take(std::size_t most, const std::function<bool(const Parcel&)>& may_go) {
  std::list<Parcel> taken;
  for (auto parcel = parcels_.begin(); parcel != parcels_.end() && taken.size() < most;) {
    parcel = may_go(*parcel) ? remove(parcel, &taken) : std::next(parcel);
  }
  return taken;
}

std::size_t Outbox::expire(SteadyTime now) {
  std::list<Parcel> old;
  for (auto parcel = parcels_.begin(); parcel != parcels_.end();) {
    parcel = parcel->until <= now ? remove(parcel, &old) : std::next(parcel);
  }
  return old.size();
}

bool Outbox::has_for(const std::string& partition) const { return listens_.contains(partition); }

}  // namespace trammel
