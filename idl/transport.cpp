#include "idl/transport.h"

#include <arpa/inet.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/attributes/LibrarySettingsAttributes.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <netinet/in.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <memory>
#include <mutex>
#include <sstream>

#include "idl/quiet_library.h"
#include "server/base/line_output.h"

namespace trammel::wire {
namespace {

namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::Duration_t;

constexpr std::uint32_t kSocketBuffer = 4u << 20;
// Bytes. On a line a datagram is one frame of an Ethernet: of a larger one a lost frame takes all others with it, so
// that a line that loses every twentieth lets hardly any of 64 kB through. The handshake of DDS-Security is not sent in
// parts: it holds certificate and permissions.
constexpr std::uint32_t kDatagramOfALine = 1400;
constexpr std::uint32_t kSecuredDatagramOfALine = 16384;
constexpr int kReplicaDepth = 16;
constexpr std::uint32_t kPortTries = 2000;
// Until a reader has confirmed everything: a lost reply is to be missed at once. A state has readers in every client.
constexpr std::chrono::milliseconds kHeartbeat{10}, kStateHeartbeat{200};

Duration_t to_duration(std::chrono::milliseconds time) {
  return {static_cast<std::int32_t>(time.count() / 1000), static_cast<std::uint32_t>(time.count() % 1000) * 1'000'000u};
}

/// The library's errors to standard error, which nobody may read any more: the library does not wait for that.
class LibraryErrors final : public dds::LogConsumer {
 public:
  void Consume(const dds::Log::Entry& entry) override {
    if (QuietLibrary::lives()) return;
    std::ostringstream line;
    print_timestamp(line, entry, false);
    print_header(line, entry, false);
    print_message(line, entry, false);
    print_context(line, entry, false);
    print_new_line(line, false);
    output_.write(line.str());
  }

 private:
  LineOutput output_{STDERR_FILENO};
};

void set_up_process() {
  static std::once_flag once;
  std::call_once(once, [] {
    // Both would silently change how participants find each other.
    unsetenv("ROS_DISCOVERY_SERVER");
    unsetenv("FASTRTPS_DEFAULT_PROFILES_FILE");
    dds::Log::SetVerbosity(dds::Log::Kind::Error);
    dds::Log::ClearConsumers();
    dds::Log::RegisterConsumer(std::make_unique<LibraryErrors>());
    // Where a test has server and clients in one process, they too talk over UDP.
    eprosima::fastrtps::LibrarySettingsAttributes settings;
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
  });
}

Status check_address(const std::string& address) {
  sockaddr_in name{};
  name.sin_family = AF_INET;
  if (inet_pton(AF_INET, address.c_str(), &name.sin_addr) != 1) {
    return failure(ErrorCode::kUsage, "address `{}` is not an IPv4 address", address);
  }
  const std::vector<std::string> own = own_addresses();
  if (std::find(own.begin(), own.end(), address) == own.end()) {
    return failure(ErrorCode::kUsage, "address {} is not one of this host's, or its interface is down", address)
        .next(fmt::format("it has {}", fmt::join(own, ", ")));
  }
  return {};
}

rtps::Locator_t locator(const std::string& address, std::uint16_t port) {
  rtps::Locator_t result;
  rtps::IPLocator::createLocator(LOCATOR_KIND_UDPv4, address, port, result);
  return result;
}

/// The builtin plugins of DDS-Security. The governance says what is signed and encrypted.
void set_security(dds::PropertyPolicyQos& properties, const Security& security) {
  const auto say = [&](const std::string& name, const std::string& value) {
    properties.properties().emplace_back("dds.sec." + name, value);
  };
  const auto file = [&](const char* name) { return "file://" + security.folder + "/" + name; };
  say("auth.plugin", "builtin.PKI-DH");
  say("auth.builtin.PKI-DH.identity_ca", file("identity_ca.cert.pem"));
  say("auth.builtin.PKI-DH.identity_certificate", file("cert.pem"));
  say("auth.builtin.PKI-DH.private_key", file("key.pem"));
  say("access.plugin", "builtin.Access-Permissions");
  say("access.builtin.Access-Permissions.permissions_ca", file("permissions_ca.cert.pem"));
  say("access.builtin.Access-Permissions.governance", file("governance.p7s"));
  say("access.builtin.Access-Permissions.permissions", file("permissions.p7s"));
  say("crypto.plugin", "builtin.AES-GCM-GMAC");
}

template <typename Qos>
void set_call_history(Qos& qos, int depth) {
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.resource_limits().max_samples = depth;
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().max_samples_per_instance = depth;
  qos.resource_limits().allocated_samples = 1;
  qos.data_sharing().off();
  // A sample's memory goes with it: histories that keep it would hold as many of the largest ones as they are deep.
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
}

template <typename Qos>
void set_state_history(Qos& qos, int depth) {
  set_call_history(qos, depth);
  qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  qos.resource_limits().max_samples = 0;
  qos.resource_limits().max_instances = 0;
}

/// As long as one reader has not confirmed everything, each heartbeat goes to all readers, and all of them answer.
void set_writer_times(dds::DataWriterQos& qos, std::chrono::milliseconds heartbeat) {
  qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = to_duration(heartbeat);
  qos.reliable_writer_qos().times.nackResponseDelay = to_duration(std::chrono::milliseconds(0));
}

void set_reader_times(dds::DataReaderQos& qos) {
  qos.reliable_reader_qos().times.heartbeatResponseDelay = to_duration(std::chrono::milliseconds(0));
  qos.reliable_reader_qos().times.initialAcknackDelay = to_duration(std::chrono::milliseconds(1));
}

}  // namespace

void ParticipantDeleter::operator()(dds::DomainParticipant* participant) const {
  participant->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant);
}

Result<ParticipantPtr> make_participant(const ParticipantOptions& options, dds::DomainParticipantListener* discovery) {
  set_up_process();
  if (const Status usable = check_address(options.address); !usable) return tl::make_unexpected(usable.error());

  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {options.address};
  udp->sendBufferSize = kSocketBuffer;
  udp->receiveBufferSize = kSocketBuffer;
  if (!options.address.starts_with("127."))
    udp->maxMessageSize = options.security ? kSecuredDatagramOfALine : kDatagramOfALine;

  dds::DomainParticipantQos qos;
  qos.name(options.name);
  const std::string mark = domain_mark(options.domain);
  qos.user_data().setValue(std::vector<unsigned char>(mark.begin(), mark.end()));
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports = {with_domain_gate(udp, options.domain, options.heard_of_itself, options.dropped)};
  qos.transport().send_socket_buffer_size = kSocketBuffer;
  qos.transport().listen_socket_buffer_size = kSocketBuffer;
  auto& builtin = qos.wire_protocol().builtin;
  builtin.discovery_config.leaseDuration = to_duration(kLease);
  builtin.discovery_config.leaseDuration_announcementperiod = to_duration(kAnnouncement);
  // Each participant of a host takes the next free ports. With the library's 100 tries the 125th has none, and is deaf.
  builtin.mutation_tries = kPortTries;
  // A list of its own, even without a port, keeps the participant from joining the default multicast group.
  builtin.metatrafficUnicastLocatorList.push_back(locator(options.address, options.listen_port));
  for (const std::uint16_t port : options.peer_ports)
    builtin.initialPeersList.push_back(locator(options.address, port));
  for (const HostPort& peer : options.peers) builtin.initialPeersList.push_back(locator(peer.address, peer.port));
  if (options.security) set_security(qos.properties(), *options.security);
  if (options.heard_of_itself) builtin.initialPeersList.push_back(locator(options.address, options.listen_port));

  dds::DomainParticipant* participant = dds::DomainParticipantFactory::get_instance()->create_participant(
      options.domain, qos, discovery, dds::StatusMask::none());
  if (participant == nullptr) {
    if (options.security) {
      return refused("DDS-Security refuses what is in it for domain {}: see the errors of the library", options.domain)
          .in(options.security->folder);
    }
    return failure(ErrorCode::kInternal, "cannot create a DDS participant on {} in domain {}", options.address,
                   options.domain);
  }
  return ParticipantPtr(participant);
}

dds::PublisherQos publisher_qos(const std::string& partition) {
  dds::PublisherQos qos;
  if (!partition.empty()) qos.partition().push_back(partition.c_str());
  return qos;
}

dds::SubscriberQos subscriber_qos(const std::string& partition) {
  dds::SubscriberQos qos;
  if (!partition.empty()) qos.partition().push_back(partition.c_str());
  return qos;
}

dds::DataWriterQos call_writer_qos(int depth) {
  dds::DataWriterQos qos;
  set_call_history(qos, depth);
  set_writer_times(qos, kHeartbeat);
  return qos;
}

dds::DataReaderQos call_reader_qos(int depth) {
  dds::DataReaderQos qos;
  set_call_history(qos, depth);
  set_reader_times(qos);
  return qos;
}

dds::DataWriterQos state_writer_qos() {
  dds::DataWriterQos qos;
  set_state_history(qos, 1);
  set_writer_times(qos, kStateHeartbeat);
  return qos;
}

dds::DataReaderQos state_reader_qos() {
  dds::DataReaderQos qos;
  set_state_history(qos, kReplicaDepth);
  set_reader_times(qos);
  return qos;
}

dds::DataWriterQos progress_writer_qos() {
  dds::DataWriterQos qos = state_writer_qos();
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  return qos;
}

dds::DataReaderQos progress_reader_qos() {
  dds::DataReaderQos qos = state_reader_qos();
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  return qos;
}

dds::DataWriterQos service_status_writer_qos() {
  dds::DataWriterQos qos = state_writer_qos();
  qos.liveliness().kind = dds::MANUAL_BY_TOPIC_LIVELINESS_QOS;
  qos.liveliness().lease_duration = to_duration(kStatusLost);
  qos.liveliness().announcement_period = to_duration(kStatusPeriod);
  return qos;
}

Result<dds::Topic*> make_topic(dds::DomainParticipant& participant, const std::string& name, dds::TopicDataType* type,
                               const std::string& type_name) {
  if (!type_name.empty()) type->setName(type_name.c_str());
  dds::TypeSupport support(type);
  dds::Topic* topic = nullptr;
  if (support.register_type(&participant) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    topic = participant.create_topic(name, support.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  }
  if (topic == nullptr) return failure(ErrorCode::kInternal, "cannot create the topic {}", name);
  return topic;
}

std::string topic_name(const char* name, const char* part) {
  return fmt::format("{}_{}{}", name, CONTRACT_VERSION, part);
}

std::string participant_of(const rtps::GUID_t& guid) {
  return {reinterpret_cast<const char*>(guid.guidPrefix.value), rtps::GuidPrefix_t::size};
}

std::array<std::uint8_t, 16> octets_of(const rtps::GUID_t& guid) {
  std::array<std::uint8_t, 16> octets{};
  const auto rest = std::copy_n(guid.guidPrefix.value, rtps::GuidPrefix_t::size, octets.begin());
  std::copy_n(guid.entityId.value, rtps::EntityId_t::size, rest);
  return octets;
}

}  // namespace trammel::wire
