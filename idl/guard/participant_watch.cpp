#include "idl/guard/participant_watch.h"

#include <algorithm>

namespace trammel::wire {

bool ParticipantWatch::may_be_new(Time now) {
  const double since_s = std::chrono::duration<double>(now - refilled_).count();
  allowed_ = std::min(kNewAtOnce, allowed_ + kNewPerSecond * since_s);
  refilled_ = now;
  if (allowed_ < 1) return false;
  --allowed_;
  return true;
}

std::optional<Dropped> ParticipantWatch::announced(Bytes prefix, std::uint64_t socket, Time now) {
  Known& participant = participants_.at(key_of(prefix, 0), now);
  if (participant.known) return {};
  EndpointKey key;
  std::memcpy(key.prefix.data(), &socket, sizeof socket);
  Socket& from = sockets_.at(key, now);
  if (now - from.since > kWindow) from = {now, 0};
  if (from.participants >= kNewOfOneSocket || !may_be_new(now)) return Dropped::kParticipants;
  ++from.participants;
  participant.known = true;
  return {};
}

}  // namespace trammel::wire
