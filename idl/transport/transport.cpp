#include "idl/transport/transport.h"

#include <algorithm>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <memory>

#include "idl/limits.h"

namespace trammel::wire {
namespace {

namespace rtps = eprosima::fastrtps::rtps;

// Bytes. On a line a datagram is one frame of an Ethernet: of a larger one a lost frame takes all
// others with it, so that a line that loses every twentieth lets hardly any of 64 kB through. The
// handshake of DDS-Security is not sent in parts: it holds certificate and permissions. Others may
// send larger ones.
constexpr std::uint32_t kDatagramOfALine = 1400;
constexpr std::uint32_t kSecuredDatagramOfALine = 16384;
constexpr int kServersDepth = 16;
// Until a reader has confirmed everything: a lost reply is to be missed at once. A state has
// readers in every client.
constexpr std::chrono::milliseconds kHeartbeat{10}, kStateHeartbeat{200};

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
  // A sample's memory goes with it: histories that keep it would hold as many of the largest ones
  // as they are deep.
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
}

template <typename Qos>
void set_state_history(Qos& qos, int depth) {
  set_call_history(qos, depth);
  qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  qos.resource_limits().max_samples = 0;
  qos.resource_limits().max_instances = 0;
}

/// As long as one reader has not confirmed everything, each heartbeat goes to all readers, and all
/// of them answer.
void set_writer_times(dds::DataWriterQos& qos, std::chrono::milliseconds heartbeat) {
  qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = to_duration(heartbeat);
  qos.reliable_writer_qos().times.nackResponseDelay = to_duration(std::chrono::milliseconds(0));
  // None between the fragments of a sample: a reader of Cyclone DDS takes what stands in the first
  // HEARTBEAT that it hears for history, and drops the sample that is being sent.
  qos.reliable_writer_qos().disable_heartbeat_piggyback = true;
}

void set_reader_times(dds::DataReaderQos& qos) {
  qos.reliable_reader_qos().times.heartbeatResponseDelay =
      to_duration(std::chrono::milliseconds(0));
  // Repeated until the writer offers something; a writer may be left by whoever died, or never mean
  // to.
  qos.reliable_reader_qos().times.initialAcknackDelay = to_duration(std::chrono::milliseconds(20));
}

}  // namespace

Result<ParticipantPtr> make_participant(const ParticipantOptions& options,
                                        dds::DomainParticipantListener* discovery) {
  const auto udp = TRY(udp_on(options.address));
  GateOptions gate{options.domain, options.heard_of_itself, options.dropped};
  if (options.security)
    gate.proof = options.security->signs ? Proof::kOfMessages : Proof::kOfIdentity;
  gate.serves = options.heard_of_itself != nullptr;
  gate.hearing = std::make_shared<Hearing>();
  for (const std::uint16_t port : options.peer_ports)
    gate.hosts.push_back(locator(options.address, port));
  for (const HostPort& peer : options.peers) gate.hosts.push_back(locator(peer.address, peer.port));
  if (options.heard_of_itself) gate.hosts.push_back(locator(options.address, options.listen_port));
  if (!options.address.starts_with("127."))
    gate.largest_sent = options.security ? kSecuredDatagramOfALine : kDatagramOfALine;

  dds::DomainParticipantQos qos =
      participant_qos(with_domain_gate(udp, gate), options.address, options.listen_port);
  qos.name(options.name);
  set_user_data(qos, domain_mark(options.domain));
  for (const auto& host : gate.hosts) qos.wire_protocol().builtin.initialPeersList.push_back(host);
  if (options.security) set_security(qos.properties(), *options.security);

  dds::DomainParticipant* participant =
      dds::DomainParticipantFactory::get_instance()->create_participant(
          options.domain, qos, discovery, dds::StatusMask::none());
  gate.hearing->begins();
  if (participant == nullptr) {
    if (options.security) {
      return refused(
                 "DDS-Security refuses what is in it for domain {}: see the errors of the library",
                 options.domain)
          .in(options.security->folder);
    }
    return failure(ErrorCode::kInternal, "cannot create a DDS participant on {} in domain {}",
                   options.address, options.domain);
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
  set_state_history(qos, kServersDepth);
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

Result<dds::Topic*> make_topic(dds::DomainParticipant& participant, const std::string& name,
                               dds::TopicDataType* type, const std::string& type_name) {
  if (!type_name.empty()) type->setName(type_name.c_str());
  dds::TypeSupport support(type);
  dds::Topic* topic = nullptr;
  if (support.register_type(&participant) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    topic = participant.create_topic(name, support.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  }
  if (topic == nullptr) return failure(ErrorCode::kInternal, "cannot create the topic {}", name);
  return topic;
}

Result<dds::Topic*> make_contract_topic(dds::DomainParticipant& participant) {
  return make_topic(participant, SpokenContractTopic::kName,
                    new SafeType<SpokenContractTopic::Type>(SpokenContractTopic::kMaxSample));
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
