#include "idl/repairs/guard/guard.h"

#include <algorithm>
#include <array>
#include <utility>

#include "idl/repairs/guard/message_check.h"

namespace trammel::wire {
namespace {

constexpr std::array<const char*, kDroppedReasons> kNames = {
    "no RTPS message",       "lengths",
    "statistics submessage", "in another's name",
    "sequence numbers",      "number sets",
    "parameter lists",       "fragments",
    "sample size",           "unfinished samples",
    "counts that jump",      "numbers skipped",
    "too many participants", "fragments that were never sent",
    "security submessages",  "partitions with wildcards",
    "too many endpoints",    "too much asked for again"};

}  // namespace

const char* name_of(Dropped reason) { return kNames[static_cast<std::size_t>(reason)]; }

Guard::Guard(std::uint32_t largest_sample, std::shared_ptr<DropCounts> counts,
             std::vector<Relay> relays, Proof proof, std::size_t most_endpoints)
    : largest_sample_(largest_sample),
      counts_(counts ? std::move(counts) : std::make_shared<DropCounts>()),
      relays_(std::move(relays)),
      proof_(proof),
      memory_(most_endpoints) {}

std::optional<Bytes> Guard::check(Bytes message, std::uint64_t socket, Time now) {
  EditedMessage edited(message);
  const bool relayed = is_of_relay(message, socket);
  MessageCheck check(
      {largest_sample_, socket, now, relayed, proof_ != Proof::kNone, proof_ == Proof::kOfMessages},
      memory_, message, edited);
  if (const auto dropped = check.run()) {
    counts_->add(*dropped);
    return std::nullopt;
  }
  if (check.left_out()) counts_->add(*check.left_out());
  return edited.bytes();
}

bool Guard::is_of_relay(Bytes message, std::uint64_t socket) const {
  if (message.size() < kHeaderBytes) return false;
  const Bytes prefix = message.subspan(kPrefixAt, kPrefix);
  return std::any_of(relays_.begin(), relays_.end(), [&](const Relay& relay) {
    return relay.address == static_cast<std::uint32_t>(socket) &&
           std::equal(prefix.begin(), prefix.end(), relay.prefix.begin());
  });
}

bool Guard::lets_out(std::uint64_t socket, Time now) {
  const MutexLock lock(memory_.mutex);
  const bool may_leave = memory_.participants.lets_out(socket, now);
  memory_.note_strangers();
  return may_leave;
}

void Guard::sent(Bytes message) {
  if (message.size() < kHeaderBytes) return;
  if (!knows_own_.exchange(true)) {
    const MutexLock lock(memory_.mutex);
    std::copy_n(message.begin() + kPrefixAt, kPrefix, memory_.own.begin());
  }
  Bytes rest = message.subspan(kHeaderBytes), to{};
  while (const auto submessage = next_submessage(rest)) {
    if (submessage->id == kInfoDestination && submessage->body.size() >= kPrefix) {
      to = submessage->body.first(kPrefix);
    } else if (submessage->id == kAckNack && !to.empty()) {
      confirm(to, *submessage);
    } else if (submessage->id == kDataFrag) {
      const auto fragments = fragments_of(*submessage);
      if (!fragments || fragments->size == 0) continue;
      const MutexLock lock(memory_.mutex);
      memory_.sent.add(*fragments);
      memory_.repairs.sent(fragments->writer, fragments->sequence_number, fragments->sample_size,
                           std::chrono::steady_clock::now());
    } else if (submessage->id == kData) {
      Reader reader(submessage->body, submessage->little_endian());
      static_cast<void>(reader.take(8));  // flags, the reader
      const auto writer = reader.entity();
      const auto number = reader.sequence_number();
      if (!writer || !number || *number < 1) continue;
      const MutexLock lock(memory_.mutex);
      memory_.repairs.sent(*writer, *number, submessage->body.size(),
                           std::chrono::steady_clock::now());
    }
  }
}

void Guard::confirm(Bytes to, const Submessage& acknack) {
  Reader reader(acknack.body, acknack.little_endian());
  if (!reader.u32()) return;
  const auto writer = reader.entity();
  const auto base = reader.sequence_number();
  if (!writer || !base) return;
  const MutexLock lock(memory_.mutex);
  memory_.sequences.confirmed(key_of(to, *writer), std::max<std::int64_t>(0, *base - 1),
                              std::chrono::steady_clock::now());
}

}  // namespace trammel::wire
