#include "idl/repairs/heartbeat_pace.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace trammel::wire {
namespace {

bool is_everybody(Bytes prefix) {
  return std::all_of(prefix.begin(), prefix.end(), [](unsigned char octet) { return octet == 0; });
}

/// The only submessage of a message that says or asks something, and whom it is for.
struct Lone {
  Submessage submessage;
  Bytes to{};  // prefix; empty: everybody
};
std::optional<Lone> lone_submessage(Bytes message) {
  if (message.size() < kHeaderBytes) return std::nullopt;
  std::optional<Lone> lone;
  Bytes to, rest = message.subspan(kHeaderBytes);
  while (const auto submessage = next_submessage(rest)) {
    if (submessage->id == kInfoTimestamp || submessage->id == kStatistics) continue;
    if (submessage->id == kSecureRtpsPrefix || submessage->id == kSecureRtpsPostfix)
      continue;  // around what is signed
    if (submessage->id == kInfoSource) continue;
    if (submessage->id == kInfoDestination && submessage->body.size() >= kPrefix) {
      to = is_everybody(submessage->body) ? Bytes() : submessage->body.first(kPrefix);
      continue;
    }
    if (lone) return std::nullopt;
    lone = Lone{*submessage, to};
  }
  return lone;
}

/// The writer of a HEARTBEAT.
std::optional<std::uint32_t> writer_of_heartbeat(const Submessage& submessage) {
  Reader body(submessage.body, submessage.little_endian());
  static_cast<void>(body.entity());  // the reader
  return body.entity();
}

/// The two of an ACKNACK that confirms nothing and asks for no number.
std::optional<std::uint32_t> ends_of_first_question(const Submessage& submessage) {
  Reader body(submessage.body, submessage.little_endian());
  const auto reader = body.entity(), writer = body.entity();
  const auto base = body.sequence_number();
  const auto bits = body.u32();
  if (!reader || !writer || base != 0 || bits != 0u) return std::nullopt;
  return *reader * 0x9e3779b1u ^ *writer;
}

}  // namespace

bool HeartbeatPace::lets_out(Bytes message, Time now) {
  const auto lone = lone_submessage(message);
  if (!lone) return true;
  if (lone->submessage.id == kHeartbeat) {
    constexpr unsigned char kSaysAlive = 0x04;
    if (!lone->to.empty() && (lone->submessage.flags & kSaysAlive) != 0) return true;
    const auto writer = writer_of_heartbeat(lone->submessage);
    if (!writer) return true;
    return lone->to.empty() ? lets_heartbeat_out(*writer, now)
                            : lets_offer_out(lone->to, *writer, now);
  }
  if (lone->submessage.id != kAckNack || lone->to.empty()) return true;
  const auto ends = ends_of_first_question(lone->submessage);
  return !ends || lets_question_out(key_of(lone->to, *ends), now);
}

bool HeartbeatPace::lets_heartbeat_out(std::uint32_t writer, Time now) {
  const auto known = std::find(kWriters.begin(), kWriters.end(), writer);
  if (known == kWriters.end()) return true;
  std::atomic<Time::rep>& last = last_[static_cast<std::size_t>(known - kWriters.begin())];
  Time::rep before = last.load();
  const Time::rep at = now.time_since_epoch().count();
  if (before != 0 && Time::duration(at - before) < kBetween) return false;
  return last.compare_exchange_strong(before, at);
}

bool HeartbeatPace::lets_offer_out(Bytes to, std::uint32_t writer, Time now) {
  const MutexLock lock(mutex_);
  Offers& offers = offers_.at(key_of(to, writer), now);
  const Time* const answered = answered_.find(key_of(to, 0), now);
  const bool is_first = now - std::exchange(offers.made, now) > kNewSeries;
  if (is_first) offers.since = now;
  if (answered != nullptr) offers.since = std::max(offers.since, *answered);
  if (now - offers.since >= kPatience && now - offers.last < kBetweenUnanswered) return false;
  offers.last = now;
  return true;
}

void HeartbeatPace::heard(Bytes message, Time now) {
  if (message.size() < kHeaderBytes) return;
  Bytes rest = message.subspan(kHeaderBytes);
  while (const auto submessage = next_submessage(rest)) {
    if (submessage->id != kAckNack && submessage->id != kNackFrag) continue;
    const MutexLock lock(mutex_);
    answered_.at(key_of(message.subspan(kPrefixAt, kPrefix), 0), now) = now;
    return;
  }
}

bool HeartbeatPace::lets_question_out(const EndpointKey& asked, Time now) {
  const MutexLock lock(mutex_);
  Questions& before = questions_.at(asked, now);
  const bool is_first = now - std::exchange(before.asked, now) > kNewSeries;
  if (!is_first && now - before.last < before.last - before.first + kBetweenQuestions) return false;
  before.last = now;
  if (is_first) before.first = now;
  return true;
}

}  // namespace trammel::wire
