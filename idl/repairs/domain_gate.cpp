#include "idl/repairs/domain_gate.h"

#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <fastdds/rtps/common/LocatorList.hpp>
#include <string_view>
#include <utility>

#include "idl/limits.h"
#include "idl/repairs/askers.h"
#include "idl/repairs/guard/guard.h"
#include "idl/repairs/heartbeat_pace.h"
#include "idl/repairs/lost_leases.h"
#include "idl/repairs/own_messages.h"
#include "server/base/mutex.h"

namespace trammel::wire {
namespace {

namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::LocatorsIterator;
using eprosima::fastrtps::rtps::SenderResource;

constexpr std::chrono::milliseconds kBetweenLosses{500};
constexpr std::uint16_t kDomainId = 0x000f, kUserData = 0x002c;
constexpr std::uint16_t kLeaseDuration = 0x0002, kDefaultUnicast = 0x0031,
                        kMetatrafficUnicast = 0x0032;
constexpr std::string_view kMark = "trammel.domain=";

std::optional<std::uint32_t> marked_domain(Bytes user_data) {
  const std::string_view text(reinterpret_cast<const char*>(user_data.data()), user_data.size());
  if (!text.starts_with(kMark)) return std::nullopt;
  std::uint32_t domain = 0;
  const auto [end, error] =
      std::from_chars(text.data() + kMark.size(), text.data() + text.size(), domain);
  if (error != std::errc()) return std::nullopt;
  return domain;
}

/// A submessage DATA.
struct Data {
  std::uint32_t writer = 0;  // entity id, its first octet the highest
  std::uint64_t sequence_number = 0;
  Bytes payload;  // empty when a participant or an instance leaves
};

std::optional<Data> data_of(Bytes body, unsigned char flags) {
  const bool little_endian = (flags & kLittleEndian) != 0;
  Reader reader(body, little_endian);
  if (!reader.u16()) return std::nullopt;
  const auto to_inline_qos = reader.u16();
  const Bytes counted_from_here = reader.rest();
  if (!to_inline_qos || !reader.take(4)) return std::nullopt;
  const auto writer = reader.take(4);
  const auto high = reader.u32(), low = reader.u32();
  if (!writer || !high || !low || *to_inline_qos > counted_from_here.size()) return std::nullopt;
  Data data;
  data.writer = Reader(*writer, false).u32().value_or(0);
  data.sequence_number = std::uint64_t{*high} << 32 | *low;
  if ((flags & kPayload) == 0) return data;
  Reader after(counted_from_here.subspan(*to_inline_qos), little_endian);
  if ((flags & kInlineQos) != 0) {
    while (next_parameter(after)) continue;
  }
  data.payload = after.rest();
  return data;
}

bool says_another_domain(Bytes announcement, std::uint32_t domain) {
  if (announcement.size() < 4) return false;
  const bool little_endian = announcement[1] == 0x03;  // PL_CDR_LE; 2 is PL_CDR_BE
  if (announcement[0] != 0 || (!little_endian && announcement[1] != 0x02)) return false;
  Reader list(announcement.subspan(4), little_endian);
  while (const auto parameter = next_parameter(list)) {
    Reader value(parameter->value, little_endian);
    const auto number = value.u32();  // the domain, or how much user data
    if (!number) continue;
    if (parameter->id == kDomainId && *number != domain) return true;
    if (parameter->id != kUserData) continue;
    const auto user_data = value.take(*number);
    if (user_data && marked_domain(*user_data).value_or(domain) != domain) return true;
  }
  return false;
}

/// The address and the lease that an announcement states for its participant.
struct Place {
  std::vector<std::uint64_t> sockets;
  std::chrono::milliseconds lease{0};  // 0: not said
};

Place place_of(Bytes announcement) {
  Place place;
  if (announcement.size() < 4) return place;
  Reader list(announcement.subspan(4), announcement[1] == 0x03);
  while (const auto parameter = next_parameter(list)) {
    Reader value(parameter->value, list.little_endian());
    if (parameter->id == kLeaseDuration) {
      place.lease = std::chrono::seconds(value.u32().value_or(0));
      continue;
    }
    if (parameter->id != kMetatrafficUnicast && parameter->id != kDefaultUnicast) continue;
    const auto kind = value.u32(), port = value.u32();
    const auto address = value.take(16);
    if (kind != std::uint32_t{LOCATOR_KIND_UDPv4} || !port || !address) continue;
    std::uint64_t socket = *port;
    for (const unsigned char octet : address->last(4)) socket = socket << 8 | octet;
    place.sockets.push_back(socket);
  }
  return place;
}

/// True if `found` is true for any DATA in the message.
template <typename Found>
bool any_data(Bytes message, const Found& found) {
  if (message.size() < kHeaderBytes) return false;
  Bytes rest = message.subspan(kHeaderBytes);
  while (const auto submessage = next_submessage(rest)) {
    if (submessage->id != kData) continue;
    const auto data = data_of(submessage->body, submessage->flags);
    if (data && found(*data)) return true;
  }
  return false;
}

class GateDescriptor;

class Gate final : public rtps::ChainingTransport {
 public:
  explicit Gate(const GateDescriptor& descriptor);

  rtps::TransportDescriptorInterface* get_configuration() override;

  bool send(SenderResource* below, const unsigned char* buffer, std::uint32_t size,
            LocatorsIterator* first, LocatorsIterator* last,
            const std::chrono::steady_clock::time_point& limit) override {
    if (size >= kHeaderBytes && !knows_itself_) {
      const MutexLock lock(mutex_);
      if (!knows_itself_) std::copy_n(buffer + kPrefixAt, kPrefix, own_prefix_.begin());
      knows_itself_ = true;
    }
    if (guard_) guard_->sent(Bytes(buffer, size));
    if (guard_) own_messages_.sent(Bytes(buffer, size));
    // A newcomer asks for the next 256 numbers at each HEARTBEAT: it hears those that the others
    // are spared.
    const bool to_all = pace_.lets_out(Bytes(buffer, size));
    if (!domain_) return !to_all || below->send(buffer, size, first, last, limit);
    const LostLeases::Time now = LostLeases::now();
    const std::vector<std::uint64_t> asking =
        to_all ? std::vector<std::uint64_t>() : askers_.sockets(now);
    if (!to_all && asking.empty()) return true;
    leases_.awake(now);
    const std::vector<std::uint64_t> silent = leases_.silent_sockets(now);
    const bool strangers = guard_ && guard_->knows_strangers();
    if (to_all && silent.empty() && !strangers)
      return below->send(buffer, size, first, last, limit);
    rtps::LocatorList rest;
    for (; *first != *last; ++*first) {
      const std::uint64_t socket = socket_of(**first);
      if (std::find(silent.begin(), silent.end(), socket) != silent.end()) continue;
      if (!to_all && std::find(asking.begin(), asking.end(), socket) == asking.end()) continue;
      if (!strangers || is_host(socket) || guard_->lets_out(socket)) rest.push_back(**first);
    }
    rtps::Locators begin(rest.begin()), end(rest.end());
    return rest.empty() || below->send(buffer, size, &begin, &end, limit);
  }

  void receive(rtps::TransportReceiverInterface* next, const unsigned char* buffer,
               std::uint32_t size, const Locator_t& here, const Locator_t& there) override {
    if (hearing_) hearing_->wait();
    if (guard_ && is_own(Bytes(buffer, size)) && !own_messages_.has(Bytes(buffer, size))) {
      dropped_->add(Dropped::kSource);
      return;
    }
    const auto passed =
        guard_ ? guard_->check(Bytes(buffer, size), socket_of(there)) : Bytes(buffer, size);
    if (!passed) return;
    const Bytes message = *passed;
    if (domain_ && is_of_another_domain(message, *domain_)) return;
    const bool own = is_own(message);
    if (own && heard_ && is_to_be_lost(message)) return;
    if (domain_ && !own && !is_let_in(message)) return;
    next->OnDataReceived(message.data(), static_cast<std::uint32_t>(message.size()), here, there);
    if (own && heard_ && is_announcement(message)) ++heard_->announcements;
  }

 private:
  /// Address and port of an IPv4 socket.
  static std::uint64_t socket_of(const Locator_t& there) {
    const auto& address = there.address;
    std::uint64_t socket = there.port;
    for (std::size_t i = 12; i < 16; ++i) socket = socket << 8 | address[i];
    return socket;
  }

  [[nodiscard]] bool is_host(std::uint64_t socket) const {
    return std::find(hosts_.begin(), hosts_.end(), socket) != hosts_.end();
  }

  [[nodiscard]] bool is_own(Bytes message) const {
    if (!knows_itself_ || message.size() < kHeaderBytes) return false;
    return std::equal(own_prefix_.begin(), own_prefix_.end(), message.begin() + kPrefixAt);
  }

  bool is_let_in(Bytes message) {
    if (message.size() < kHeaderBytes) return true;
    const LostLeases::Time now = LostLeases::now();
    leases_.awake(now);
    LostLeases::Prefix prefix;
    std::copy_n(message.begin() + kPrefixAt, kPrefix, prefix.begin());
    if (!leases_.lets_in(prefix, now)) return false;
    if (asks_for_endpoints(message)) askers_.asks(prefix, now);
    pace_.heard(message);
    any_data(message, [&](const Data& data) {
      if (data.writer != kAnnouncer) return false;
      if (data.payload.empty()) {
        leases_.left(prefix);
        return true;
      }
      Place place = place_of(data.payload);
      askers_.announced(prefix, place.sockets, now);
      if (place.lease.count() > 0)
        leases_.announced(prefix, std::move(place.sockets), place.lease, now);
      return true;
    });
    return true;
  }

  bool is_to_be_lost(Bytes message) {
    const std::uint32_t writer = heard_->first_lost_of;
    if (writer == 0) return false;
    return any_data(message, [&](const Data& data) {
      if (data.writer != writer) return false;
      const MutexLock lock(mutex_);
      const auto now = std::chrono::steady_clock::now();
      if (data.sequence_number <= last_lost_ || now - lost_at_ < kBetweenLosses) return false;
      last_lost_ = data.sequence_number;
      lost_at_ = now;
      return true;
    });
  }

  std::unique_ptr<GateDescriptor> configuration_;
  const std::optional<std::uint32_t> domain_;
  const std::shared_ptr<HeardOfItself> heard_;
  const std::shared_ptr<Hearing> hearing_;
  const std::shared_ptr<DropCounts> dropped_;  // null as guard_ is
  const std::unique_ptr<Guard> guard_;
  OwnMessages own_messages_;
  std::vector<std::uint64_t> hosts_;  // their sockets
  HeartbeatPace pace_;
  LostLeases leases_{kLease};
  Askers askers_;
  std::atomic<bool> knows_itself_{false};
  Mutex mutex_;
  std::array<unsigned char, kPrefix> own_prefix_{};         // written once, before knows_itself_
  std::uint64_t last_lost_ TRAMMEL_GUARDED_BY(mutex_) = 0;  // sequence number
  std::chrono::steady_clock::time_point lost_at_ TRAMMEL_GUARDED_BY(mutex_);
};

class GateDescriptor final : public rtps::ChainingTransportDescriptor {
 public:
  GateDescriptor(std::shared_ptr<rtps::TransportDescriptorInterface> below, GateOptions of,
                 bool all, std::vector<Relay> believed)
      : ChainingTransportDescriptor(std::move(below)),
        options(std::move(of)),
        all_domains(all),
        relays(std::move(believed)) {}

  rtps::TransportInterface* create_transport() const override { return new Gate(*this); }
  /// A datagram that is sent has no more. The transport below receives what it is configured for
  /// itself.
  std::uint32_t max_message_size() const override {
    return std::min(options.largest_sent, ChainingTransportDescriptor::max_message_size());
  }

  GateOptions options;
  bool all_domains;
  std::vector<Relay> relays;
};

Gate::Gate(const GateDescriptor& descriptor)
    : ChainingTransport(descriptor),
      configuration_(std::make_unique<GateDescriptor>(descriptor)),
      domain_(descriptor.all_domains ? std::nullopt : std::optional(descriptor.options.domain)),
      heard_(descriptor.options.heard),
      hearing_(descriptor.options.hearing),
      dropped_(descriptor.options.dropped),
      guard_(descriptor.options.dropped
                 ? std::make_unique<Guard>(static_cast<std::uint32_t>(kMaxTextSample),
                                           descriptor.options.dropped, descriptor.relays,
                                           descriptor.options.proof,
                                           descriptor.options.serves ? EndpointWatch::kMostOfClient
                                                                     : EndpointWatch::kMostOfServer)
                 : nullptr) {
  for (const Locator_t& host : descriptor.options.hosts) hosts_.push_back(socket_of(host));
}

rtps::TransportDescriptorInterface* Gate::get_configuration() { return configuration_.get(); }

}  // namespace

std::string domain_mark(std::uint32_t domain) { return fmt::format("{}{}", kMark, domain); }

bool is_of_another_domain(std::span<const unsigned char> message, std::uint32_t domain) {
  return any_data(message, [domain](const Data& data) {
    return data.writer == kAnnouncer && says_another_domain(data.payload, domain);
  });
}

bool is_announcement(std::span<const unsigned char> message) {
  return any_data(
      message, [](const Data& data) { return data.writer == kAnnouncer && !data.payload.empty(); });
}

std::shared_ptr<rtps::TransportDescriptorInterface> with_domain_gate(
    std::shared_ptr<rtps::TransportDescriptorInterface> below, const GateOptions& options) {
  return std::make_shared<GateDescriptor>(std::move(below), options, false, std::vector<Relay>());
}

std::shared_ptr<rtps::TransportDescriptorInterface> with_relay_guard(
    std::shared_ptr<rtps::TransportDescriptorInterface> below, std::vector<Relay> relays) {
  GateOptions options;
  options.dropped = std::make_shared<DropCounts>();
  return std::make_shared<GateDescriptor>(std::move(below), options, true, std::move(relays));
}

}  // namespace trammel::wire
