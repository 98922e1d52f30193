#include <algorithm>

#include "idl/repairs/guard/message_check.h"
#include "idl/repairs/guard/number_set.h"

namespace trammel::wire {

std::optional<Dropped> MessageCheck::check_acknack(const Submessage& submessage) {
  constexpr std::uint32_t kAcks = 0x01000000;  // no entity kind: these count apart from HEARTBEATs
  Reader reader(submessage.body, submessage.little_endian());
  const auto head = take_head(reader);
  const auto base = reader.sequence_number();
  if (!head || !base) return Dropped::kLength;
  if (*base < 0 || *base > kLargestNumber) return Dropped::kNumber;
  const NumberSet set = take_set(reader);
  if (set.fault) return set.fault;
  const auto count = reader.u32();
  if (!count) return Dropped::kLength;
  if (set.count > 0) {
    if (const Fault fault = check_repairs(head->writer, *base, set, reader.little_endian()))
      return fault;
  }
  return check_count(head->reader, head->writer ^ kAcks, *count);
}

/// The first of the numbers asked for pass, as far as they may be sent again now. The reader asks
/// for the rest anew.
std::optional<Dropped> MessageCheck::check_repairs(std::uint32_t writer, std::int64_t base,
                                                   const NumberSet& asked, bool little_endian) {
  const MutexLock lock(memory_.mutex);
  // The library sends nothing to those that it does not know.
  if (!memory_.participants.is_there(source_, received_.now)) return {};
  const double allowed = memory_.repairs.allowed(source_, received_.now);
  if (allowed <= 0) return Dropped::kRepairs;
  double bytes = 0;
  bool is_full = false;
  for (std::uint32_t at = 0; at < asked.bits; at += 32) {
    const Bytes place = asked.words.subspan(at / 8, 4);
    const std::uint32_t word = Reader(place, little_endian).u32().value_or(0);
    std::uint32_t passes = word;
    for (std::uint32_t i = 0; i < std::min<std::uint32_t>(32, asked.bits - at); ++i) {
      const std::uint32_t bit = 0x80000000u >> i;
      if ((word & bit) == 0) continue;
      const double more =
          is_full ? 0 : memory_.repairs.bytes_of(writer, base + at + i, received_.now);
      is_full = is_full || bytes + more > allowed;
      if (is_full) {
        passes &= ~bit;
      } else {
        bytes += more;
      }
    }
    if (passes != word) edited_.put(place, passes, little_endian);
  }
  if (is_full) left_out_ = Dropped::kRepairs;
  memory_.repairs.charge(source_, bytes, received_.now);
  return {};
}

std::optional<Dropped> MessageCheck::check_nack_frag(const Submessage& submessage) {
  constexpr std::uint32_t kNacks = 0x02000000;
  Reader reader(submessage.body, submessage.little_endian());
  const auto head = take_head(reader);
  const auto number = reader.sequence_number();
  const auto base = reader.u32();
  if (!head || !number || !base) return Dropped::kLength;
  if (!is_number(number) || *base < 1) return Dropped::kNumber;
  const NumberSet set = take_set(reader);
  if (set.fault) return set.fault;
  const auto count = reader.u32();
  if (!count) return Dropped::kLength;
  if (std::uint64_t{*base} + kMostBits > UINT32_MAX) return Dropped::kNotSent;
  {
    const MutexLock lock(memory_.mutex);
    const std::uint32_t each =
        memory_.sent.fragment_bytes(head->writer, *number, *base + set.highest);
    if (each == 0) return Dropped::kNotSent;
    if (memory_.participants.is_there(source_, received_.now)) {
      if (memory_.repairs.allowed(source_, received_.now) <= 0) return Dropped::kRepairs;
      memory_.repairs.charge(source_, static_cast<double>(each) * set.count, received_.now);
    }
  }
  return check_count(head->reader, head->writer ^ kNacks, *count);
}

std::optional<Dropped> MessageCheck::check_count(std::uint32_t endpoint, std::uint32_t tag,
                                                 std::uint32_t count) {
  const MutexLock lock(memory_.mutex);
  const std::uint32_t mixed = endpoint * 0x9e3779b1u ^ tag;
  return memory_.sequences.count(key_of(source_, mixed), count, received_.now)
             ? Fault()
             : Fault(Dropped::kCount);
}

}  // namespace trammel::wire
