#include "idl/repairs/guard/message_check.h"

#include <algorithm>
#include <array>

#include "idl/repairs/guard/announcement_check.h"
#include "idl/repairs/guard/cut_sample.h"
#include "idl/repairs/guard/number_set.h"

namespace trammel::wire {
namespace {

constexpr std::uint32_t kPublications = 0x000003c2, kSubscriptions = 0x000004c2,
                        kLiveliness = 0x000200c2;
constexpr std::uint32_t kSecureAnnouncer = 0xff0101c2, kSecurePublications = 0xff0003c2,
                        kSecureSubscriptions = 0xff0004c2, kSecureLiveliness = 0xff0200c2;
constexpr std::uint32_t kHandshake = 0x000201c3, kHandshakeReader = 0x000201c4;
constexpr std::uint32_t kMostHistory = 1u << 24;  // samples that a HEARTBEAT may offer
constexpr std::size_t kStatisticsBody =
    56;  // a locator, a time, a sequence; as this library lays it out
constexpr std::size_t kSmallestFragment =
    64;  // the library keeps a list in the first octets of each
constexpr std::size_t kGapBody = 28;

bool is_announcement_writer(std::uint32_t writer) {
  return writer == kAnnouncer || writer == kPublications || writer == kSubscriptions ||
         writer == kSecureAnnouncer || writer == kSecurePublications ||
         writer == kSecureSubscriptions;
}
bool is_liveliness_writer(std::uint32_t writer) {
  return writer == kLiveliness || writer == kSecureLiveliness;
}
}  // namespace

std::optional<Fragments> fragments_of(const Submessage& submessage) {
  Reader reader(submessage.body, submessage.little_endian());
  if (!reader.take(4)) return std::nullopt;
  const auto head = take_head(reader);
  const auto number = reader.sequence_number();
  const auto first = reader.u32();
  const auto count = reader.u16(), size = reader.u16();
  const auto sample_size = reader.u32();
  if (!head || !number || !first || !count || !size || !sample_size) return std::nullopt;
  return Fragments{head->writer, *number, *first, *count, *size, *sample_size};
}

std::optional<Dropped> MessageCheck::run() {
  if (const Fault fault = check_header()) return fault;
  source_ = message_.subspan(kPrefixAt, kPrefix);
  named_ = received_.relayed ? Bytes() : source_;
  Bytes rest = message_.subspan(kHeaderBytes);
  while (!rest.empty()) {
    const auto submessage = next_submessage(rest);
    if (!submessage) return Dropped::kLength;
    if (!rest.empty() && submessage->body.size() % 4 != 0) return Dropped::kLength;
    if (const Fault fault = check_submessage(*submessage, rest)) return fault;
  }
  return {};
}

std::optional<Dropped> MessageCheck::check_header() {
  constexpr std::array<unsigned char, 5> kBegin = {'R', 'T', 'P', 'S', 2};
  if (message_.size() < kHeaderBytes || message_.size() > EditedMessage::kMost)
    return Dropped::kHeader;
  if (!std::equal(kBegin.begin(), kBegin.end(), message_.begin())) return Dropped::kHeader;
  const Bytes prefix = message_.subspan(kPrefixAt, kPrefix);
  if (std::all_of(prefix.begin(), prefix.end(), [](unsigned char b) { return b == 0; }))
    return Dropped::kSource;
  return {};
}

std::optional<Dropped> MessageCheck::check_submessage(const Submessage& submessage, Bytes behind) {
  const auto at_least = [&](std::size_t size) -> Fault {
    return submessage.body.size() < size ? Fault(Dropped::kLength) : Fault();
  };
  if (lacks_proof(submessage)) {
    blank(submessage);
    left_out_ = Dropped::kSecurity;
    return {};
  }
  switch (submessage.id) {
    case kData:
      return received_.relayed ? check_relayed_data(submessage) : check_data(submessage);
    case kDataFrag:
      return check_fragments(submessage);
    case kHeartbeat:
      return check_heartbeat(submessage);
    case kHeartbeatFrag:
      return check_heartbeat_frag(submessage);
    case kGap:
      return check_gap(submessage);
    case kAckNack:
      return check_acknack(submessage);
    case kNackFrag:
      return check_nack_frag(submessage);
    case kInfoTimestamp:
      return (submessage.flags & kInlineQos) != 0 ? Fault() : at_least(8);
    case kInfoDestination:
      return check_destination(submessage);
    case kInfoSource:
      return signed_ && repeats_source(submessage.body) ? Fault() : Fault(Dropped::kSource);
    case kStatistics:
      return check_statistics(submessage, behind);
    case kSecureRtpsPrefix:
      signed_ = received_.signs;  // elsewhere the library has no key for it
      return check_secured(submessage, behind);
    case kSecurePrefix:
    case kSecurePostfix:
      wrapped_ = submessage.id == kSecurePrefix;
      return check_secured(submessage, behind);
    case kSecureBody:
    case kSecureRtpsPostfix:
      return check_secured(submessage, behind);
    default:
      return {};  // the library skips it
  }
}

std::optional<Dropped> MessageCheck::check_data(const Submessage& submessage) {
  Reader reader(submessage.body, submessage.little_endian());
  if (!reader.u16()) return Dropped::kLength;
  const auto to_inline_qos = reader.u16();
  Reader after(reader.rest(), reader.little_endian());
  const auto head = take_head(reader);
  const auto number = reader.sequence_number();
  if (!to_inline_qos || !head || !number || *to_inline_qos < 16 || !after.take(*to_inline_qos))
    return Dropped::kLength;
  if (!is_number(number)) return Dropped::kNumber;

  const bool announcement = is_announcement_writer(head->writer);
  bool says_status = false;
  const Reader inline_qos = after;
  if ((submessage.flags & kInlineQos) != 0) {
    if (const Fault fault = check_inline_qos(after, named_, announcement, says_status))
      return fault;
  }
  const bool payload = (submessage.flags & kPayload) != 0, key = (submessage.flags & kKey) != 0;
  if (payload && key) return Dropped::kLength;
  if (is_unproven(head->writer) && (!payload || says_status)) {
    ignore_end(head->writer, submessage, *number);
    return {};
  }
  if ((!payload || says_status) && head->writer == kAnnouncer && !received_.relayed) {
    // To a reader that nobody has. The library would forget the participant here, while it may be
    // looking in another thread whether its lease is over: an assertion of PDP.cpp then ends the
    // process.
    if (!signed_)
      edited_.put(submessage.body.subspan(4, 4),
                  std::array<unsigned char, 4>{0xff, 0xff, 0xff, 0xff});
    const MutexLock lock(memory_.mutex);
    memory_.participants.left(source_);
    memory_.endpoints.left(source_);
    memory_.note_strangers();
  }
  const bool of_endpoint = head->writer == kPublications || head->writer == kSubscriptions;
  const bool has_ended = (!payload || says_status) && of_endpoint && !received_.relayed;
  if (has_ended && (submessage.flags & kInlineQos) != 0)
    note_end_of_endpoint(guid_in_inline_qos(inline_qos));
  if (!payload && !key) return says_status ? Fault() : Fault(Dropped::kLength);
  if (after.rest().size() < 4) return Dropped::kLength;
  if (has_ended && key) note_end_of_endpoint(guid_in_key(after.rest()));
  if (!payload) return announcement ? check_key_of_gone(submessage, after.rest()) : Fault();
  const bool handshake = head->writer == kHandshake || head->reader == kHandshakeReader;
  return handshake ? check_handshake(after.rest(), source_)
                   : check_announced(submessage, head->writer, *number, after.rest());
}

/// Cyclone DDS says by a key alone who has gone. The library takes that from the inline QoS only:
/// the key moves there, over the sentinel of the QoS and its own beginning.
std::optional<Dropped> MessageCheck::check_key_of_gone(const Submessage& data, Bytes key) {
  constexpr std::uint16_t kKeyHash = 0x0070;
  const auto guid = guid_in_key(key);
  if (!guid) return Dropped::kParameters;
  if (!std::equal(named_.begin(), named_.end(), guid->begin())) return Dropped::kSource;
  if ((data.flags & kInlineQos) == 0) return {};
  const Bytes place = message_.subspan(static_cast<std::size_t>(key.data() - message_.data()) - 4,
                                       8 + guid->size());
  edited_.put(place.first(2), kKeyHash, data.little_endian());
  edited_.put(place.subspan(2, 2), static_cast<std::uint16_t>(guid->size()), data.little_endian());
  edited_.put(place.subspan(4, guid->size()), *guid);
  edited_.put(place.last(4).first(2), kSentinel, data.little_endian());
  edited_.put(place.last(2), std::uint16_t{0}, data.little_endian());
  edited_.put(flags_of(data), std::array{static_cast<unsigned char>(data.flags & ~kKey)});
  return {};
}

/// The writer is reliable: what never arrives is asked for again for ever, and all behind it waits.
/// So what may not pass is said not to exist.
std::optional<Dropped> MessageCheck::check_relayed_data(const Submessage& submessage) {
  const Fault fault = check_data(submessage);
  if (!fault) return {};
  Reader reader(submessage.body, submessage.little_endian());
  if (!reader.take(4) || !take_head(reader) || submessage.body.size() < kGapBody) return fault;
  const auto number = reader.sequence_number();
  if (!is_number(number)) return fault;
  make_gap(submessage, *number);
  return {};
}

/// In place: it skips this one number.
void MessageCheck::make_gap(const Submessage& data, std::int64_t number) {
  const bool little_endian = data.little_endian();
  edited_.put(id_of(data), std::array<unsigned char, 1>{kGap});
  edited_.put(flags_of(data), std::array{static_cast<unsigned char>(data.flags & kLittleEndian)});
  edited_.put(data.body.first(16),
              data.body.subspan(4, 16));  // reader, writer, the first number that is skipped
  edited_.put_sequence_number(data.body.subspan(16, 8), number + 1, little_endian);
  edited_.put(data.body.subspan(24, 4), std::uint32_t{0}, little_endian);
}

/// Where participants prove who they are: whether a writer of announcements is one that anybody can
/// speak for.
bool MessageCheck::is_unproven(std::uint32_t writer) const {
  return received_.secured && !signed_ &&
         (writer == kAnnouncer || writer == kPublications || writer == kSubscriptions);
}

/// True if it speaks for an endpoint whose words are all proven, and proves nothing: anybody could
/// have sent it, to make a reader skip what it has not read.
bool MessageCheck::lacks_proof(const Submessage& submessage) const {
  if (!received_.secured || signed_) return false;
  const bool data = submessage.id == kData || submessage.id == kDataFrag;
  const bool other = submessage.id == kHeartbeat || submessage.id == kHeartbeatFrag ||
                     submessage.id == kGap || submessage.id == kAckNack ||
                     submessage.id == kNackFrag;
  if (!data && !other) return false;
  Reader reader(submessage.body, submessage.little_endian());
  if (data && !reader.take(4)) return false;
  const auto head = take_head(reader);
  if (!head) return false;
  const bool of_topic = (head->writer & kBuiltIn) != kBuiltIn;
  return (is_of_security(head->writer) && !wrapped_) || (of_topic && received_.signs);
}

/// A message that is signed may begin with its header once more.
bool MessageCheck::repeats_source(Bytes body) const {
  return body.size() >= kPrefix &&
         std::equal(source_.begin(), source_.end(), body.last(kPrefix).begin());
}

/// Said without proof, that a participant has gone, or one of its endpoints: its lease decides.
/// Writers of endpoints' announcements are reliable, so of them the number is skipped.
void MessageCheck::ignore_end(std::uint32_t writer, const Submessage& data, std::int64_t number) {
  if (writer != kAnnouncer && data.body.size() >= kGapBody) return make_gap(data, number);
  blank(data);
}

Bytes MessageCheck::id_of(const Submessage& submessage) const {
  return message_.subspan(static_cast<std::size_t>(submessage.body.data() - message_.data()) - 4,
                          1);
}

Bytes MessageCheck::flags_of(const Submessage& submessage) const {
  return message_.subspan(static_cast<std::size_t>(submessage.body.data() - message_.data()) - 3,
                          1);
}

void MessageCheck::blank(const Submessage& submessage) {
  edited_.put(id_of(submessage), std::array<unsigned char, 1>{kPad});
}

/// Who names us has heard us.
std::optional<Dropped> MessageCheck::check_destination(const Submessage& submessage) {
  if (submessage.body.size() < kPrefix) return Dropped::kLength;
  if (!memory_.knows_strangers) return {};
  const MutexLock lock(memory_.mutex);
  if (memory_.is_own(submessage.body.first(kPrefix)))
    memory_.participants.spoke(source_, received_.now);
  memory_.note_strangers();
  return {};
}

std::optional<Dropped> MessageCheck::check_announced(const Submessage& submessage,
                                                     std::uint32_t writer, std::int64_t number,
                                                     Bytes payload) {
  Reachable reachable;
  if (is_announcement_writer(writer)) {
    if (const Fault fault = check_announcement(payload, named_, edited_, reachable)) return fault;
  }
  if (is_liveliness_writer(writer) && payload.size() < 24) return Dropped::kLength;
  if (!is_announcement_writer(writer) || received_.relayed) return {};
  const MutexLock lock(memory_.mutex);
  if (memory_.is_own(source_)) return {};
  if (writer != kAnnouncer) {
    check_endpoint(submessage, number, reachable);
    return {};
  }
  NamedSockets here;
  for (const std::uint64_t socket : reachable.sockets.all()) {
    if (static_cast<std::uint32_t>(socket) == static_cast<std::uint32_t>(received_.socket))
      here.add(socket);
  }
  blank_others(reachable, here);
  const auto admission = memory_.participants.announced(source_, received_.socket, reachable,
                                                        received_.secured, received_.now);
  memory_.note_strangers();
  const auto lease = static_cast<std::uint32_t>(admission.lease.count());
  if (admission.ignored) {
    blank(submessage);
  } else if (!admission.dropped && lease < reachable.lease_seconds) {
    edited_.put(reachable.lease.first(4), lease, reachable.little_endian);
  }
  return admission.dropped;
}

/// The library knows no endpoints of participants that it does not know.
void MessageCheck::check_endpoint(const Submessage& submessage, std::int64_t number,
                                  Reachable& reachable) {
  if (!memory_.participants.is_there(source_, received_.now)) return;
  for (const auto& prefix : memory_.endpoints.to_be_looked_at()) {
    if (!memory_.participants.is_there(prefix, received_.now)) memory_.endpoints.left(prefix);
  }
  if (reachable.endpoint && !memory_.endpoints.found(source_, *reachable.endpoint) &&
      submessage.body.size() >= kGapBody) {
    make_gap(submessage, number);
    left_out_ = Dropped::kEndpoints;
    return;
  }
  NamedSockets own;
  for (const std::uint64_t socket : reachable.sockets.all()) {
    if (memory_.participants.listens_at(source_, socket, received_.now)) own.add(socket);
  }
  blank_others(reachable, own);
}

void MessageCheck::note_end_of_endpoint(std::optional<Bytes> guid) {
  if (!guid) return;
  const MutexLock lock(memory_.mutex);
  memory_.endpoints.lost(source_, Reader(guid->last(4), false).entity().value_or(0));
}

/// The library would send there without end. Where none is left of an endpoint it takes those of
/// its participant.
void MessageCheck::blank_others(Reachable& reachable, const NamedSockets& allowed) {
  constexpr std::uint16_t kPadding = 0;
  const auto all = reachable.sockets.all();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!allowed.has(all[i])) edited_.put(reachable.stands[i], kPadding, reachable.little_endian);
  }
  reachable.sockets = allowed;
}

std::optional<Dropped> MessageCheck::check_fragments(const Submessage& submessage) {
  const auto fragments = fragments_of(submessage);
  if (!fragments) return Dropped::kLength;
  if (!is_number(fragments->sequence_number)) return Dropped::kNumber;
  const bool too_large = fragments->sample_size > received_.largest_sample;
  if (too_large && fragments->first != 1) return Dropped::kSampleSize;
  if ((fragments->writer & kBuiltIn) == kBuiltIn) return Dropped::kFragment;
  if (fragments->size < kSmallestFragment || fragments->first < 1 || fragments->count < 1)
    return Dropped::kFragment;
  const std::uint64_t last = std::uint64_t{fragments->first} + fragments->count - 1;
  if (last > fragments->of_sample()) return Dropped::kFragment;

  Reader reader(submessage.body, submessage.little_endian());
  reader.u16();
  const auto to_inline_qos = reader.u16();
  Reader after(reader.rest(), reader.little_endian());
  if (!to_inline_qos || *to_inline_qos < 28 || !after.take(*to_inline_qos)) return Dropped::kLength;
  bool says_status = false;
  if ((submessage.flags & kInlineQos) != 0) {
    if (const Fault fault = check_inline_qos(after, source_, false, says_status)) return fault;
  }
  const std::uint64_t begin = std::uint64_t{fragments->first - 1} * fragments->size;
  const std::uint64_t end = std::min<std::uint64_t>(last * fragments->size, fragments->sample_size);
  if (after.rest().size() < end - begin) return Dropped::kFragment;
  if (too_large) return cut_too_large(submessage, after.rest(), fragments->sample_size);
  const MutexLock lock(memory_.mutex);
  return memory_.unfinished.add(source_, *fragments, received_.now);
}

/// The writer is reliable: what never arrives is asked for again for ever, and all behind it waits.
/// So the first fragment becomes a whole sample, in place, and its reader tells the writer why it
/// is refused.
std::optional<Dropped> MessageCheck::cut_too_large(const Submessage& submessage, Bytes payload,
                                                   std::uint32_t sample_size) {
  constexpr unsigned char kKeyOfFragment = 0x04;
  if ((submessage.flags & kKeyOfFragment) != 0) return Dropped::kSampleSize;
  const auto flags =
      static_cast<unsigned char>((submessage.flags & (kLittleEndian | kInlineQos)) | kPayload);
  edited_.put(id_of(submessage), std::array<unsigned char, 1>{kData});
  edited_.put(flags_of(submessage), std::array{flags});
  edited_.put(payload.subspan(kOptionsAt, 2), options_of_cut(sample_size));
  return {};
}

std::optional<Dropped> MessageCheck::check_heartbeat(const Submessage& submessage) {
  Reader reader(submessage.body, submessage.little_endian());
  const auto head = take_head(reader);
  const Bytes first_field = reader.rest();
  const auto first = reader.sequence_number(), last = reader.sequence_number();
  const auto count = reader.u32();
  if (!head || !first || !last || !count) return Dropped::kLength;
  if (!is_number(first) || *last < *first - 1 || *last > kLargestNumber) return Dropped::kNumber;
  if (*last - *first > kMostHistory) return Dropped::kNumber;
  const MutexLock lock(memory_.mutex);
  if (!memory_.sequences.count(key_of(source_, head->writer), *count, received_.now))
    return Dropped::kCount;
  const auto step =
      signed_ || wrapped_ ? SequenceWatch::kSignedStep : SequenceWatch::kHeartbeatStep;
  const std::int64_t allowed =
      memory_.sequences.heartbeat(key_of(source_, head->writer), *first, step, received_.now);
  if (allowed >= *first) return {};
  if (signed_ || wrapped_) return Dropped::kSkipped;  // a signature does not outlive a change
  edited_.put_sequence_number(first_field.first(8), allowed, reader.little_endian());
  return {};
}

std::optional<Dropped> MessageCheck::check_heartbeat_frag(const Submessage& submessage) {
  Reader reader(submessage.body, submessage.little_endian());
  const auto head = take_head(reader);
  const auto number = reader.sequence_number();
  const auto last = reader.u32(), count = reader.u32();
  if (!head || !number || !last || !count) return Dropped::kLength;
  return is_number(number) && *last > 0 ? Fault() : Fault(Dropped::kNumber);
}

std::optional<Dropped> MessageCheck::check_gap(const Submessage& submessage) {
  Reader reader(submessage.body, submessage.little_endian());
  const auto head = take_head(reader);
  const Bytes fields = reader.rest();
  const auto start = reader.sequence_number(), base = reader.sequence_number();
  if (!head || !start || !base) return Dropped::kLength;
  if (!is_number(start) || !is_number(base) || *base < *start) return Dropped::kNumber;
  if (const NumberSet set = take_set(reader); set.fault) return set.fault;
  const MutexLock lock(memory_.mutex);
  const auto range =
      memory_.sequences.gap(key_of(source_, head->writer), {*start, *base}, received_.now);
  if (range.start == *start && range.end == *base) return {};
  if (range.end <= range.start || signed_ || wrapped_) return Dropped::kSkipped;
  edited_.put_sequence_number(fields.first(8), range.start, reader.little_endian());
  if (range.end == *base) return {};
  edited_.put_sequence_number(fields.subspan(8, 8), range.end, reader.little_endian());
  edited_.put(fields.subspan(16, 4), std::uint32_t{0}, reader.little_endian());  // none beyond it
  return {};
}

std::optional<Dropped> MessageCheck::check_statistics(const Submessage& submessage, Bytes behind) {
  if (!behind.empty() || submessage.body.size() != kStatisticsBody) return Dropped::kStatistics;
  edited_.cut_to(static_cast<std::size_t>(submessage.body.data() - message_.data()) - 4);
  return {};
}

std::optional<Dropped> MessageCheck::check_secured(const Submessage& submessage, Bytes behind) {
  constexpr std::size_t kTransformation = 20, kMac = 16;
  const std::size_t size = submessage.body.size();
  const auto counted = [&](std::size_t before, std::size_t each) {
    Reader reader(submessage.body, false);
    const auto skipped = reader.take(before);
    const auto count = reader.u32();
    return skipped && count && std::uint64_t{*count} * each <= reader.rest().size();
  };
  switch (submessage.id) {
    case kSecurePrefix:
    case kSecureRtpsPrefix:
      return size >= kTransformation && !behind.empty() ? Fault() : Fault(Dropped::kSecurity);
    case kSecureBody:
      return counted(0, 1) && !behind.empty() ? Fault() : Fault(Dropped::kSecurity);
    default:
      return counted(kMac, 4 + kMac) ? Fault() : Fault(Dropped::kSecurity);
  }
}

}  // namespace trammel::wire
