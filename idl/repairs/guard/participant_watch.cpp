#include "idl/repairs/guard/participant_watch.h"

#include <algorithm>
#include <utility>

namespace trammel::wire {
namespace {

EndpointKey key_of_socket(std::uint64_t socket) {
  EndpointKey key;
  std::memcpy(key.prefix.data(), &socket, sizeof socket);
  return key;
}

/// FNV-1a, of words.
std::uint64_t said_in(const Reachable& reachable) {
  std::uint64_t mixed = 0xcbf29ce484222325u;
  const auto mix = [&mixed](std::uint64_t word) { mixed = (mixed ^ word) * 0x100000001b3u; };
  mix(reachable.lease_seconds);
  for (const std::uint64_t socket : reachable.sockets.all()) mix(socket);
  return mixed;
}

}  // namespace

bool ParticipantWatch::may_be_new(Time now) {
  const double since_s = std::chrono::duration<double>(now - refilled_).count();
  allowed_ = std::min(kStrangersAtOnce, allowed_ + kStrangersPerSecond * since_s);
  refilled_ = now;
  if (allowed_ < 1) return false;
  --allowed_;
  return true;
}

bool ParticipantWatch::has_room(const EndpointKey& key, Time now) {
  if (participants_.count([now](const Participant& one) { return one.until > now; }) >= kMost)
    return false;
  return strangers_.size() < kCrowd || std::exchange(seen_.at(key, now).before, true);
}

ParticipantWatch::Admission ParticipantWatch::announced(Bytes prefix, std::uint64_t socket,
                                                        const Reachable& reachable, bool pinned,
                                                        Time now) {
  const EndpointKey key = key_of(prefix, 0);
  const std::chrono::seconds lease(reachable.lease_seconds),
      short_lease = std::min(lease, kStrangersLease);
  Participant* const known = participants_.find(key, now);
  const bool is_known = known != nullptr && known->until > now;
  if (is_known && !known->is_stranger) {
    if (pinned && known->said != said_in(reachable)) return {{}, lease, true};
    hear_again(key, *known, reachable, now);
    return {{}, lease};
  }
  // Without a lease that can be cut the library would keep a stranger for kUsualLeaseSeconds.
  if (reachable.lease.empty()) return {Dropped::kParticipants};
  forget_strangers(now);
  if (is_known) {
    hear_again(key, *known, reachable, now);
    return {{}, short_lease};
  }
  Socket& from = sockets_.at(key_of_socket(socket), now);
  if (now - from.since > kWindow) from = {now, 0};
  if (from.participants >= kNewOfOneSocket || !has_room(key, now) || !may_be_new(now))
    return {Dropped::kParticipants};
  ++from.participants;
  participants_.at(key, now) = {now + short_lease, true, said_in(reachable), reachable.sockets};
  strangers_.push_back({key, now + short_lease, kAnswers, reachable.sockets});
  return {{}, short_lease};
}

void ParticipantWatch::hear_again(const EndpointKey& key, Participant& known,
                                  const Reachable& reachable, Time now) {
  const std::chrono::seconds lease(reachable.lease_seconds);
  known.until = now + (known.is_stranger ? std::min(lease, kStrangersLease) : lease);
  known.said = said_in(reachable);
  known.sockets = reachable.sockets;
  if (!known.is_stranger) return note_sockets(reachable.sockets, now, known.until);
  if (Stranger* one = stranger(key))
    *one = {key, known.until, std::min(one->answers, kAnswers) + kAnswers, reachable.sockets};
}

void ParticipantWatch::spoke(Bytes prefix, Time now) {
  const EndpointKey key = key_of(prefix, 0);
  Participant* known = participants_.find(key, now);
  if (known == nullptr || !known->is_stranger) return;
  known->is_stranger = false;
  allowed_ = std::min(kStrangersAtOnce, allowed_ + 1);
  if (const Stranger* one = stranger(key)) note_sockets(one->sockets, now, known->until);
  forget_stranger(key);
}

void ParticipantWatch::left(Bytes prefix) {
  const EndpointKey key = key_of(prefix, 0);
  participants_.forget(key);
  forget_stranger(key);
}

bool ParticipantWatch::is_there(Bytes prefix, Time now) {
  const Participant* const known = participants_.find(key_of(prefix, 0), now);
  return known != nullptr && known->until > now;
}

bool ParticipantWatch::listens_at(Bytes prefix, std::uint64_t socket, Time now) {
  const Participant* const known = participants_.find(key_of(prefix, 0), now);
  return known != nullptr && known->until > now && known->sockets.has(socket);
}

void ParticipantWatch::forget_strangers(Time now) {
  std::erase_if(strangers_, [now](const Stranger& one) { return one.until <= now; });
}

void ParticipantWatch::forget_stranger(const EndpointKey& key) {
  std::erase_if(strangers_, [&key](const Stranger& one) { return one.key == key; });
}

ParticipantWatch::Stranger* ParticipantWatch::stranger(const EndpointKey& key) {
  const auto found = std::find_if(strangers_.begin(), strangers_.end(),
                                  [&key](const Stranger& one) { return one.key == key; });
  return found == strangers_.end() ? nullptr : &*found;
}

void ParticipantWatch::note_sockets(const NamedSockets& sockets, Time now, Time until) {
  for (const std::uint64_t socket : sockets.all())
    listens_.at(key_of_socket(socket), now).until = until;
}

bool ParticipantWatch::lets_out(std::uint64_t socket, Time now) {
  forget_strangers(now);
  const Listens* known = listens_.find(key_of_socket(socket), now);
  if (known != nullptr && known->until > now) return true;
  bool named = false;
  for (Stranger& one : strangers_) {
    if (!one.sockets.has(socket)) continue;
    named = true;
    if (one.answers <= 0) continue;
    --one.answers;
    return true;
  }
  return !named;
}

}  // namespace trammel::wire
