#include "idl/transport/places.h"

#include <arpa/inet.h>
#include <fastdds/rtps/attributes/ServerAttributes.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <utility>

#include "idl/repairs/domain_gate.h"
#include "idl/repairs/guard/relay.h"
#include "idl/transport/transport.h"

namespace trammel::wire {
namespace {

namespace rtps = eprosima::fastrtps::rtps;

constexpr std::string_view kServer = "trammel.server=", kDomain = ";domain=", kId = ";id=";
constexpr const char* kTopic = "trammel_place";
constexpr std::size_t kMostText = 160, kMostId = 64;  // bytes
constexpr std::uint32_t kHighestDomain = 232;
constexpr std::uint16_t kLowestPort = 1024;

/// The text before `end`, which is taken off with it; empty where `end` is not there.
std::string_view take_until(std::string_view& text, std::string_view end) {
  const std::size_t at = text.find(end);
  if (at == std::string_view::npos) return {};
  const std::string_view front = text.substr(0, at);
  text.remove_prefix(at + end.size());
  return front;
}

template <typename Number>
Number number_in(std::string_view text, Number otherwise) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && end == text.data() + text.size() ? number : otherwise;
}

std::uint32_t number_of(const std::string& address) {
  in_addr number{};
  return inet_pton(AF_INET, address.c_str(), &number) == 1 ? ntohl(number.s_addr) : 0;
}

/// Neither 0.x nor a group.
bool is_host(const std::string& address) {
  if (address.find_first_not_of("0123456789.") != std::string::npos)
    return false;  // nor a NUL, where C would end it
  const std::uint32_t first = number_of(address) >> 24;
  return first > 0 && first < 224;
}

bool is_id(std::string_view id) {
  constexpr std::string_view kLetters =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
  return !id.empty() && id.size() <= kMostId &&
         id.find_first_not_of(kLetters) == std::string_view::npos;
}

class Looker final : public dds::DomainParticipantListener {
 public:
  explicit Looker(FoundPlaces& found) : found_(found) {}

  void on_participant_discovery(dds::DomainParticipant* /*participant*/,
                                rtps::ParticipantDiscoveryInfo&& info) override {
    const auto& user_data = info.info.m_userData;
    found_.heard({reinterpret_cast<const char*>(user_data.data()), user_data.size()});
  }

 private:
  FoundPlaces& found_;
};

std::vector<Relay> relays_of(const rtps::RemoteServerList_t& servers,
                             const std::vector<HostPort>& places) {
  std::vector<Relay> relays;
  std::size_t i = 0;
  for (const auto& server : servers) {
    Relay relay{{}, number_of(places[i++].address)};
    std::copy_n(server.guidPrefix.value, kPrefix, relay.prefix.begin());
    relays.push_back(relay);
  }
  return relays;
}

rtps::RemoteServerList_t remote(const std::vector<HostPort>& places) {
  rtps::RemoteServerList_t servers;
  int number = 0;
  for (const HostPort& place : places) {
    rtps::RemoteServerAttributes server;
    rtps::get_server_client_default_guidPrefix(number++, server.guidPrefix);
    server.metatrafficUnicastLocatorList.push_back(locator(place.address, place.port));
    servers.push_back(server);
  }
  return servers;
}

/// It talks to the discovery servers and nobody else.
Result<ParticipantPtr> client_of(const std::vector<HostPort>& discovery_servers,
                                 const std::string& address, rtps::DiscoveryProtocol_t protocol,
                                 const std::string& user_data,
                                 dds::DomainParticipantListener* listener) {
  const auto udp = TRY(udp_on(address));
  const auto servers = remote(discovery_servers);
  dds::DomainParticipantQos qos =
      participant_qos(with_relay_guard(udp, relays_of(servers, discovery_servers)), address, 0);
  qos.name("trammel place");
  set_user_data(qos, user_data);
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.discoveryProtocol = protocol;
  discovery.m_DiscoveryServers = servers;
  dds::DomainParticipant* participant =
      dds::DomainParticipantFactory::get_instance()->create_participant(0, qos, listener,
                                                                        dds::StatusMask::none());
  if (participant == nullptr)
    return failure(ErrorCode::kInternal,
                   "cannot create a DDS participant for discovery servers on {}", address);
  return ParticipantPtr(participant);
}

}  // namespace

std::string place_text(const Place& place) {
  return fmt::format("{}{}{}{}{}{}", kServer, to_string(place.at), kDomain, place.domain, kId,
                     place.server_id);
}

std::optional<Place> read_place(std::string_view text) {
  if (text.size() > kMostText || !text.starts_with(kServer)) return std::nullopt;
  std::string_view rest = text.substr(kServer.size());
  Place place;
  place.at.address = take_until(rest, ":");
  place.at.port = number_in<std::uint16_t>(take_until(rest, kDomain), 0);
  place.domain = number_in<std::uint32_t>(take_until(rest, kId), kHighestDomain + 1);
  place.server_id = rest;
  if (!is_host(place.at.address) || place.at.port < kLowestPort || place.domain > kHighestDomain ||
      !is_id(rest))
    return std::nullopt;
  return place_text(place) == text ? std::optional(place) : std::nullopt;  // one spelling only
}

void FoundPlaces::heard(std::string_view user_data) {
  const auto place = read_place(user_data);
  if (!place || place->domain != domain_ || (far_ && place->at.address.starts_with("127."))) return;
  const MutexLock lock(mutex_);
  if (places_.size() >= kMostPlaces ||
      std::find(places_.begin(), places_.end(), place->at) != places_.end())
    return;
  places_.push_back(place->at);
  changed_.notify_all();
}

std::vector<HostPort> FoundPlaces::wait(std::chrono::milliseconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  MutexLock lock(mutex_);
  const auto any = [this]() TRAMMEL_REQUIRES(mutex_) { return !places_.empty(); };
  const auto enough = [this]() TRAMMEL_REQUIRES(mutex_) { return places_.size() >= kMostPlaces; };
  if (changed_.wait_until(lock, deadline, any))
    changed_.wait_until(lock, std::min(deadline, std::chrono::steady_clock::now() + kOtherPlaces),
                        enough);
  return places_;
}

Result<ParticipantPtr> announce_place(const Place& place,
                                      const std::vector<HostPort>& discovery_servers) {
  auto beacon = client_of(discovery_servers, place.at.address, rtps::DiscoveryProtocol_t::CLIENT,
                          place_text(place), nullptr);
  if (!beacon) return beacon;
  // A discovery server passes on nobody who has no endpoint. Nothing is ever written.
  const auto topic = TRY(make_topic(
      **beacon, kTopic, new SafeType<ServiceStatusTopic::Type>(ServiceStatusTopic::kMaxSample)));
  dds::Publisher* const publisher = (*beacon)->create_publisher(publisher_qos({}));
  if (publisher == nullptr || publisher->create_datawriter(topic, state_writer_qos()) == nullptr)
    return failure(ErrorCode::kInternal, "cannot create the writer that discovery servers pass on");
  return beacon;
}

Result<std::vector<HostPort>> look_for_places(const std::vector<HostPort>& discovery_servers,
                                              std::uint32_t domain,
                                              std::chrono::milliseconds limit) {
  const auto address = TRY(own_address_towards(discovery_servers.front().address));
  FoundPlaces found(domain, !address.starts_with("127."));
  Looker looker(found);
  const auto participant = TRY(
      client_of(discovery_servers, address, rtps::DiscoveryProtocol_t::SUPER_CLIENT, {}, &looker));
  std::vector<HostPort> places = found.wait(limit);
  if (!places.empty()) return places;
  std::vector<std::string> asked;
  for (const HostPort& one : discovery_servers) asked.push_back(to_string(one));
  return failure(ErrorCode::kUnreachable,
                 "no discovery server told of a server of domain {} within {} ms: {}", domain,
                 limit.count(), fmt::join(asked, ", "))
      .next(
          "does fast-discovery-server run there, in this order from -i 0, and is it in the server "
          "file?");
}

}  // namespace trammel::wire
