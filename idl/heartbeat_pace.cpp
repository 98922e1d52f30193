#include "idl/heartbeat_pace.h"

#include <algorithm>
#include <optional>

namespace trammel::wire {
namespace {

bool is_everybody(Bytes prefix) {
  return std::all_of(prefix.begin(), prefix.end(), [](unsigned char octet) { return octet == 0; });
}

/// The writer of the only HEARTBEAT of a message that holds nothing else and is for no participant in particular.
std::optional<std::uint32_t> writer_of_lone_heartbeat(Bytes message) {
  if (message.size() < kHeader) return std::nullopt;
  std::optional<std::uint32_t> writer;
  Bytes rest = message.subspan(kHeader);
  while (const auto submessage = next_submessage(rest)) {
    Reader body(submessage->body, submessage->little_endian());
    if (submessage->id == kInfoTimestamp || submessage->id == kStatistics) continue;
    if (submessage->id == kInfoDestination && is_everybody(submessage->body)) continue;
    if (submessage->id != kHeartbeat || writer) return std::nullopt;
    static_cast<void>(body.entity());  // the reader
    writer = body.entity();
  }
  return writer;
}

}  // namespace

bool HeartbeatPace::lets_out(Bytes message, Time now) {
  const auto writer = writer_of_lone_heartbeat(message);
  const auto known = writer ? std::find(kWriters.begin(), kWriters.end(), *writer) : kWriters.end();
  if (known == kWriters.end()) return true;
  std::atomic<Time::rep>& last = last_[static_cast<std::size_t>(known - kWriters.begin())];
  Time::rep before = last.load();
  const Time::rep at = now.time_since_epoch().count();
  if (before != 0 && Time::duration(at - before) < kBetween) return false;
  return last.compare_exchange_strong(before, at);
}

}  // namespace trammel::wire
