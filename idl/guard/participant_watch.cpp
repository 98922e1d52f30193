#include "idl/guard/participant_watch.h"

#include <algorithm>
#include <utility>

namespace trammel::wire {

bool ParticipantWatch::may_be_new(Time now) {
  const double since_s = std::chrono::duration<double>(now - refilled_).count();
  allowed_ = std::min(kNewAtOnce, allowed_ + kNewPerSecond * since_s);
  refilled_ = now;
  if (allowed_ < 1) return false;
  --allowed_;
  return true;
}

bool ParticipantWatch::has_room(const EndpointKey& key, Time now) {
  const std::size_t known = participants_.count([now](const Participant& one) { return one.until > now; });
  if (known < kCrowd) return true;
  Stranger& stranger = strangers_.at(key, now);
  return std::exchange(stranger.seen, true) && known < kMost;
}

std::optional<Dropped> ParticipantWatch::announced(Bytes prefix, std::uint64_t socket, std::chrono::seconds lease,
                                                   Time now) {
  const EndpointKey key = key_of(prefix, 0);
  if (Participant* known = participants_.find(key, now); known != nullptr && known->until > now) {
    known->until = now + lease;
    return {};
  }
  EndpointKey address;
  std::memcpy(address.prefix.data(), &socket, sizeof socket);
  Socket& from = sockets_.at(address, now);
  if (now - from.since > kWindow) from = {now, 0};
  if (from.participants >= kNewOfOneSocket || !has_room(key, now) || !may_be_new(now)) return Dropped::kParticipants;
  ++from.participants;
  participants_.at(key, now).until = now + lease;
  return {};
}

void ParticipantWatch::left(Bytes prefix) { participants_.forget(key_of(prefix, 0)); }

}  // namespace trammel::wire
