#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

/// The bytes of an RTPS 2.3 message (chapter 9.4 of the standard).
namespace trammel::wire {

using Bytes = std::span<const unsigned char>;

inline constexpr std::size_t kHeaderBytes = 20;  ///< "RTPS", version, vendor, prefix
inline constexpr std::size_t kPrefixAt = 8, kPrefix = 12;

enum SubmessageId : unsigned char {
  kPad = 0x01,
  kAckNack = 0x06,
  kHeartbeat = 0x07,
  kGap = 0x08,
  kInfoTimestamp = 0x09,
  kInfoSource = 0x0c,
  kInfoReplyIp4 = 0x0d,
  kInfoDestination = 0x0e,
  kInfoReply = 0x0f,
  kNackFrag = 0x12,
  kHeartbeatFrag = 0x13,
  kData = 0x15,
  kDataFrag = 0x16,
  kSecureBody = 0x30,
  kSecurePrefix = 0x31,
  kSecurePostfix = 0x32,
  kSecureRtpsPrefix = 0x33,
  kSecureRtpsPostfix = 0x34,
  kStatistics = 0x80,  ///< of eProsima
};

inline constexpr unsigned char kLittleEndian = 0x01, kInlineQos = 0x02, kPayload = 0x04,
                               kKey = 0x08;

inline constexpr std::uint32_t kBuiltIn =
    0xc0;  ///< in the last octet of an entity id: of discovery, no topic

/// True if an endpoint is one of those that DDS-Security adds and that say nothing in the clear:
/// not that of liveliness, which plants leave unprotected.
inline constexpr bool is_of_security(std::uint32_t entity) {
  constexpr std::uint32_t kLiveliness = 0xff0200c2;
  return entity >> 24 == 0xff && entity != kLiveliness;
}

inline constexpr std::uint32_t kAnnouncer = 0x000100c2;  ///< writer of participants' announcements

/// Reads from the front. Empty when too few bytes are left.
class Reader {
 public:
  Reader(Bytes bytes, bool little_endian) : rest_(bytes), little_endian_(little_endian) {}

  std::optional<Bytes> take(std::size_t count) {
    if (count > rest_.size()) return std::nullopt;
    const Bytes front = rest_.first(count);
    rest_ = rest_.subspan(count);
    return front;
  }
  std::optional<std::uint16_t> u16() {
    const auto b = take(2);
    if (!b) return std::nullopt;
    const auto first = static_cast<unsigned>((*b)[0]), second = static_cast<unsigned>((*b)[1]);
    return static_cast<std::uint16_t>(little_endian_ ? first | second << 8 : first << 8 | second);
  }
  std::optional<std::uint32_t> u32() {
    const auto b = take(4);
    if (!b) return std::nullopt;
    return number(*b, little_endian_);
  }
  /// An entity id, its first octet the highest.
  std::optional<std::uint32_t> entity() {
    const auto b = take(4);
    if (!b) return std::nullopt;
    return number(*b, false);
  }
  /// A sequence number: its high half first, whatever the byte order.
  std::optional<std::int64_t> sequence_number() {
    const auto high = u32(), low = u32();
    if (!high || !low) return std::nullopt;
    return static_cast<std::int64_t>(std::uint64_t{*high} << 32 | *low);
  }
  [[nodiscard]] Bytes rest() const { return rest_; }
  [[nodiscard]] bool little_endian() const { return little_endian_; }

 private:
  static std::uint32_t number(Bytes four, bool little_endian) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | four[little_endian ? 3 - i : i];
    return value;
  }

  Bytes rest_;
  bool little_endian_;
};

/// The parameters of a list (9.4.2.11).
struct Parameter {
  std::uint16_t id = 0;
  Bytes value;
};
inline constexpr std::uint16_t kSentinel = 0x0001;

/// The next parameter of a list; empty at its end.
inline std::optional<Parameter> next_parameter(Reader& list) {
  const auto id = list.u16();
  const auto length = list.u16();
  if (!id || !length || *id == kSentinel) return std::nullopt;
  const auto value = list.take(*length);
  if (!value) return std::nullopt;
  return Parameter{*id, *value};
}

struct Submessage {
  unsigned char id = 0;
  unsigned char flags = 0;
  Bytes body;
  [[nodiscard]] bool little_endian() const { return (flags & kLittleEndian) != 0; }
};

/// The next submessage of `rest`, which is shortened by it; empty at the end, or when its length is
/// not within `rest`. A length of 0 means: to the end of the message, but for the two kinds that
/// may be empty.
inline std::optional<Submessage> next_submessage(Bytes& rest) {
  if (rest.size() < 4) return std::nullopt;
  Submessage result{rest[0], rest[1], {}};
  Reader reader(rest.subspan(2), result.little_endian());
  std::size_t length = reader.u16().value_or(0);
  const Bytes behind = reader.rest();
  if (length == 0 && result.id != kPad && result.id != kInfoTimestamp) length = behind.size();
  if (length > behind.size()) return std::nullopt;
  result.body = behind.first(length);
  rest = behind.subspan(length);
  return result;
}

}  // namespace trammel::wire
