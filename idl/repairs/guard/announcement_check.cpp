#include "idl/repairs/guard/announcement_check.h"

#include <algorithm>
#include <string_view>

namespace trammel::wire {
namespace {

using Fault = std::optional<Dropped>;

enum ParameterId : std::uint16_t {
  kPadding = 0x0000,
  kLease = 0x0002,
  kTopicName = 0x0005,
  kTypeName = 0x0007,
  kProtocolVersion = 0x0015,
  kVendor = 0x0016,
  kPartition = 0x0029,
  kUserData = 0x002c,
  kGroupData = 0x002d,
  kTopicData = 0x002e,
  kUnicastLocator = 0x002f,
  kMulticastLocator = 0x0030,
  kDefaultUnicastLocator = 0x0031,
  kMetatrafficUnicastLocator = 0x0032,
  kMetatrafficMulticastLocator = 0x0033,
  kContentFilter = 0x0035,
  kDefaultMulticastLocator = 0x0048,
  kParticipantGuid = 0x0050,
  kPropertyList = 0x0059,
  kEndpointGuid = 0x005a,
  kEntityName = 0x0062,
  kTypeId = 0x0069,
  kKeyHash = 0x0070,
  kStatusInfo = 0x0071,
  kTypeObject = 0x0072,
  kDataRepresentation = 0x0073,
  kTypeInformation = 0x0075,
  kIdentityToken = 0x1001,
  kPermissionsToken = 0x1002,
  kDataSharing = 0x8006,
};

constexpr std::size_t kLocator = 24, kGuid = 16;
constexpr unsigned char kListBigEndian = 0x02,
                        kListLittleEndian = 0x03;  // how a list is serialized
constexpr std::uint32_t kMostItems =
    256;                           // partitions, properties, representations of one endpoint
constexpr int kMostLocators = 64;  // of one announcement

/// A length and that many bytes, padded to 4.
bool skip_octets(Reader& value) {
  const auto length = value.u32();
  if (!length) return false;
  const std::size_t padded = (std::size_t{*length} + 3) & ~std::size_t{3};
  return value.take(padded).has_value() ||
         (*length == value.rest().size() && value.take(*length).has_value());
}

/// As octets, and its last byte is the NUL that the library looks for.
bool skip_string(Reader& value) {
  Reader ahead = value;
  const auto length = ahead.u32();
  if (!length || *length > ahead.rest().size()) return false;
  if (*length > 0 && ahead.rest()[*length - 1] != 0) return false;
  return skip_octets(value);
}

template <typename Skip>
bool skip_items(Reader& value, const Skip& skip) {
  const auto count = value.u32();
  if (!count || *count > kMostItems) return false;
  for (std::uint32_t i = 0; i < *count; ++i) {
    if (!skip(value)) return false;
  }
  return true;
}

bool skip_property(Reader& value) { return skip_string(value) && skip_string(value); }
bool skip_binary_property(Reader& value) { return skip_string(value) && skip_octets(value); }
template <typename SkipBinary>
bool skip_token_with(Reader& value, const SkipBinary& skip_binary) {
  return skip_string(value) && skip_items(value, skip_property) && skip_items(value, skip_binary);
}
bool skip_token(Reader& value) { return skip_token_with(value, skip_binary_property); }

/// A list of texts that the library reads until their NUL. Empty partition names have length 0
/// or 1.
bool skip_partition(Reader& value) {
  const std::size_t before = value.rest().size();
  return skip_string(value) && before - value.rest().size() > 4;
}

bool fits(std::uint16_t id, Reader value) {
  switch (id) {
    case kTopicName:
    case kTypeName:
    case kEntityName:
      return skip_string(value);
    case kUserData:
    case kGroupData:
    case kTopicData:
      return skip_octets(value);
    case kPartition:
      return skip_items(value, skip_partition);
    case kPropertyList:
      return skip_items(value, skip_property);
    case kIdentityToken:
    case kPermissionsToken:
      return skip_token(value);
    case kDataRepresentation:
      return skip_items(value, [](Reader& v) { return v.take(2).has_value(); });
    case kDataSharing:
      return skip_items(value, [](Reader& v) { return v.take(8).has_value(); });
    case kUnicastLocator:
    case kMulticastLocator:
    case kDefaultUnicastLocator:
    case kDefaultMulticastLocator:
    case kMetatrafficUnicastLocator:
    case kMetatrafficMulticastLocator:
      return value.rest().size() == kLocator;
    case kLease:
      return value.rest().size() == 8;
    case kProtocolVersion:
    case kVendor:
      return value.rest().size() == 4;
    case kParticipantGuid:
    case kEndpointGuid:
    case kKeyHash:
      return value.rest().size() == kGuid;
    default:
      return true;
  }
}

bool is_locator(std::uint16_t id) {
  return id == kUnicastLocator || id == kMulticastLocator || id == kDefaultUnicastLocator ||
         id == kDefaultMulticastLocator || id == kMetatrafficUnicastLocator ||
         id == kMetatrafficMulticastLocator;
}

bool is_of(Bytes guid, Bytes source) {
  return std::equal(source.begin(), source.end(), guid.begin());
}

/// False when the lease is negative.
bool cut_lease(const Parameter& lease, EditedMessage& message, Reachable& reachable) {
  const std::uint32_t seconds = Reader(lease.value, reachable.little_endian).u32().value_or(0);
  constexpr std::uint32_t kForever = 0x7fffffff;
  if (seconds > kForever) return false;
  reachable.lease = lease.value;
  reachable.lease_seconds = std::min(seconds, kLongestLeaseSeconds);
  if (reachable.lease_seconds != seconds)
    message.put(lease.value.first(4), reachable.lease_seconds, reachable.little_endian);
  return true;
}

/// False when there are too many of them. `locator` fits(), and its id stands `at`.
bool take_locator(Reader locator, Bytes at, Reachable& reachable) {
  locator.take(4);  // the kind: of another one than UDP over IPv4 nothing is sent
  const std::uint64_t port = locator.u32().value_or(0);
  constexpr std::size_t kBeforeIpv4 = 12;
  locator.take(kBeforeIpv4);
  const std::size_t number = reachable.sockets.all().size();
  if (!reachable.sockets.add(port << 32 | locator.entity().value_or(0))) return false;
  reachable.stands[number] = at;
  return true;
}

/// A reader whose partition has wildcards would get every client's replies. `list` fits().
bool has_wildcard(Reader list) {
  constexpr std::string_view kWildcards = "*?[\\";
  const std::uint32_t count = list.u32().value_or(0);
  for (std::uint32_t i = 0; i < count; ++i) {
    Reader ahead = list;
    const Bytes name = ahead.take(ahead.u32().value_or(0)).value_or(Bytes());
    if (std::find_first_of(name.begin(), name.end(), kWildcards.begin(), kWildcards.end()) !=
        name.end())
      return true;
    if (!skip_partition(list)) return false;
  }
  return false;
}

bool is_blanked(std::uint16_t id) {
  return id == kTypeId || id == kTypeObject || id == kTypeInformation || id == kContentFilter;
}

/// The list's next parameter, its length a multiple of 4. `list` is left behind the sentinel at the
/// end.
struct Next {
  Fault fault;
  std::optional<Parameter> parameter;
};
Next next_checked(Reader& list) {
  const auto id = list.u16();
  const auto length = list.u16();
  if (!id || !length) return {Dropped::kParameters, {}};
  if (*id == kSentinel) return {};
  const auto value = list.take(*length);
  if (!value || *length % 4 != 0) return {Dropped::kParameters, {}};
  return {{}, Parameter{*id, *value}};
}

/// The GUID in an announcement as the handshake has it, which the library holds against the
/// certificate, and against nothing else. `list` is big endian.
bool announces(Reader list, Bytes source) {
  while (true) {
    const auto id = list.u16();
    const auto length = list.u16();
    if (!id || !length || *id == kSentinel) return false;
    if (*id == kParticipantGuid || *id == kKeyHash)
      return list.rest().size() >= kGuid && is_of(list.rest(), source);
    if (!list.take((std::size_t{*length} + 3) & ~std::size_t{3})) return false;
  }
}

/// True if a binary property of the handshake, which fits, proves no other source.
bool proves_no_other(Reader property, Bytes source) {
  constexpr std::string_view kAnnouncement = "c.pdata";
  Reader ahead = property;
  const Bytes name = ahead.take(ahead.u32().value_or(0)).value_or(Bytes());
  if (name.size() < kAnnouncement.size() ||
      !std::equal(kAnnouncement.begin(), kAnnouncement.end(), name.begin()))
    return true;
  skip_string(property);
  const auto length = property.u32();
  return length && *length <= property.rest().size() &&
         announces(Reader(property.rest().first(*length), false), source);
}

}  // namespace

Fault check_inline_qos(Reader& rest, Bytes source, bool names_source, bool& says_status) {
  while (true) {
    const Next next = next_checked(rest);
    if (next.fault) return next.fault;
    if (!next.parameter) return {};
    const Parameter& parameter = *next.parameter;
    if (parameter.id == kStatusInfo) says_status = true;
    if (parameter.id == kKeyHash && parameter.value.size() != kGuid) return Dropped::kParameters;
    if (parameter.id == kStatusInfo && parameter.value.size() != 4) return Dropped::kParameters;
    if (parameter.id == kKeyHash && names_source && !is_of(parameter.value, source))
      return Dropped::kSource;
  }
}

Fault check_announcement(Bytes payload, Bytes source, EditedMessage& message,
                         Reachable& reachable) {
  if (payload.size() < 4 || payload[0] != 0) return Dropped::kParameters;
  if (payload[1] != kListBigEndian && payload[1] != kListLittleEndian) return Dropped::kParameters;
  const bool little_endian = payload[1] == kListLittleEndian;
  reachable.little_endian = little_endian;
  Reader list(payload.subspan(4), little_endian);
  int locators = 0;
  while (true) {
    const Bytes here = list.rest();
    const Next next = next_checked(list);
    if (next.fault) return next.fault;
    if (!next.parameter) return {};
    const Parameter& parameter = *next.parameter;
    if (is_blanked(parameter.id)) {
      message.put(here.first(2), std::uint16_t{kPadding}, little_endian);
      continue;
    }
    if (!fits(parameter.id, Reader(parameter.value, little_endian))) return Dropped::kParameters;
    if (is_locator(parameter.id) && ++locators > kMostLocators) return Dropped::kParameters;
    if (is_locator(parameter.id) &&
        !take_locator(Reader(parameter.value, little_endian), here.first(2), reachable))
      message.put(here.first(2), std::uint16_t{kPadding}, little_endian);
    const bool names = parameter.id == kParticipantGuid || parameter.id == kEndpointGuid ||
                       parameter.id == kKeyHash;
    if (names && !is_of(parameter.value, source)) return Dropped::kSource;
    if (parameter.id == kEndpointGuid)
      reachable.endpoint = Reader(parameter.value.last(4), false).entity();
    if (parameter.id == kPartition && has_wildcard(Reader(parameter.value, little_endian)))
      return Dropped::kWildcard;
    if (parameter.id == kLease && !cut_lease(parameter, message, reachable))
      return Dropped::kParameters;
  }
}

std::optional<Bytes> guid_in_inline_qos(Reader inline_qos) {
  while (const auto parameter = next_parameter(inline_qos)) {
    if (parameter->id == kKeyHash && parameter->value.size() == kGuid) return parameter->value;
  }
  return std::nullopt;
}

std::optional<Bytes> guid_in_key(Bytes key) {
  if (key.size() < 4 || key[0] != 0 || (key[1] != kListBigEndian && key[1] != kListLittleEndian))
    return std::nullopt;
  Reader list(key.subspan(4), key[1] == kListLittleEndian);
  while (const auto parameter = next_parameter(list)) {
    const bool names = parameter->id == kParticipantGuid || parameter->id == kEndpointGuid ||
                       parameter->id == kKeyHash;
    if (names && parameter->value.size() == kGuid) return parameter->value;
  }
  return std::nullopt;
}

Fault check_handshake(Bytes payload, Bytes source) {
  constexpr std::size_t kIdentities = 24 + 24 + 16 + 16 + 16;  // two messages, three GUIDs
  if (payload.size() < 4 || payload[0] != 0 || payload[1] > 1) return Dropped::kParameters;
  Reader reader(payload.subspan(4), payload[1] == 1);
  const auto identities = reader.take(kIdentities);
  if (!identities) return Dropped::kParameters;
  bool is_own = is_of(*identities, source);
  const auto skip_binary = [&](Reader& value) {
    const Bytes property = value.rest();
    if (!skip_binary_property(value)) return false;
    is_own = is_own && proves_no_other(Reader(property, value.little_endian()), source);
    return true;
  };
  const auto skip = [&](Reader& value) { return skip_token_with(value, skip_binary); };
  if (!skip_string(reader) || !skip_items(reader, skip)) return Dropped::kParameters;
  return is_own ? Fault() : Dropped::kSource;
}

}  // namespace trammel::wire
