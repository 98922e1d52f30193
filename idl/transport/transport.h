#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/publisher/qos/PublisherQos.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/subscriber/qos/SubscriberQos.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/repairs/domain_gate.h"
#include "idl/repairs/safe_type.h"
#include "idl/topics.h"
#include "idl/transport/participant.h"
#include "idl/transport/security.h"
#include "server/base/host_port.h"
#include "server/base/result.h"

/// The way in which samples travel: one participant set-up and one set of QoS for the server and
/// all clients.
namespace trammel::wire {

struct ParticipantOptions {
  std::string name;
  std::uint32_t domain = 0;
  std::string address = "127.0.0.1";      ///< IPv4 of the only interface that is used
  std::uint16_t listen_port = 0;          ///< where others look for it; 0 = any
  std::vector<std::uint16_t> peer_ports;  ///< on `address`: where it looks for others
  /// If set, the participant is its own peer on `listen_port`, and its announcements are counted
  /// when they come back.
  std::shared_ptr<HeardOfItself> heard_of_itself = {};
  /// Counts what the guard drops.
  std::shared_ptr<DropCounts> dropped = std::make_shared<DropCounts>();
  std::vector<HostPort> peers = {};  ///< where else it looks for others: on other hosts, too
  std::optional<Security> security =
      {};  ///< who it is, and what it may do; empty: everybody is believed
};

/// UDPv4 on one interface, as udp_on(). Ignores other domains. One per process. `discovery`
/// outlives it and gets discovery events only.
[[nodiscard]] Result<ParticipantPtr> make_participant(
    const ParticipantOptions& options, dds::DomainParticipantListener* discovery = nullptr);

[[nodiscard]] dds::PublisherQos publisher_qos(const std::string& partition);
[[nodiscard]] dds::SubscriberQos subscriber_qos(const std::string& partition);

/// Requests and replies: reliable, volatile, the last `depth` kept, so that a dead peer never
/// blocks a writer.
[[nodiscard]] dds::DataWriterQos call_writer_qos(int depth);
[[nodiscard]] dds::DataReaderQos call_reader_qos(int depth);
/// State topics: reliable, transient local, the last sample of each of any number of keys; a reader
/// keeps a few, because several servers write the same keys.
[[nodiscard]] dds::DataWriterQos state_writer_qos();
[[nodiscard]] dds::DataReaderQos state_reader_qos();
/// TrainingProgress is volatile instead: earlier progress is asked for with READ_JOB.
[[nodiscard]] dds::DataWriterQos progress_writer_qos();
[[nodiscard]] dds::DataReaderQos progress_reader_qos();
/// ServiceStatus is also written every kStatusPeriod, and its liveliness is lost after kStatusLost.
[[nodiscard]] dds::DataWriterQos service_status_writer_qos();

/// A topic of this type, under the name that the type has itself or, if given, `type_name`. Owned
/// by the participant.
[[nodiscard]] Result<dds::Topic*> make_topic(dds::DomainParticipant& participant,
                                             const std::string& name, dds::TopicDataType* type,
                                             const std::string& type_name = {});

/// The name of a topic of this contract: `PredictError_2_Request`, `ServiceStatus_2`. `part`:
/// `_Request`, `_Reply` or empty.
[[nodiscard]] std::string topic_name(const char* name, const char* part = "");

template <typename Operation>
[[nodiscard]] Result<dds::Topic*> make_request_topic(dds::DomainParticipant& participant) {
  return make_topic(participant, topic_name(Operation::kName, "_Request"),
                    new SafeType<typename Operation::Request>(Operation::kMaxSample));
}
/// The topic for the side that receives: its samples are Received. `unreadable` counts those that
/// are dropped.
template <typename Operation>
[[nodiscard]] Result<dds::Topic*> make_received_topic(
    dds::DomainParticipant& participant,
    const std::shared_ptr<std::atomic<std::uint64_t>>& unreadable) {
  return make_topic(
      participant, topic_name(Operation::kName, "_Request"),
      new ReceivedType<typename Operation::Request>(Operation::kMaxSample, unreadable));
}
template <typename Operation>
[[nodiscard]] Result<dds::Topic*> make_reply_topic(dds::DomainParticipant& participant) {
  return make_topic(participant, topic_name(Operation::kName, "_Reply"),
                    new SafeType<typename Operation::Reply>(Operation::kMaxSample));
}
template <typename State>
[[nodiscard]] Result<dds::Topic*> make_state_topic(dds::DomainParticipant& participant) {
  return make_topic(participant, topic_name(State::kName),
                    new SafeType<typename State::Type>(State::kMaxSample));
}

[[nodiscard]] Result<dds::Topic*> make_contract_topic(dds::DomainParticipant& participant);

/// The participant that an endpoint belongs to: its first 12 octets.
[[nodiscard]] std::string participant_of(const eprosima::fastrtps::rtps::GUID_t& guid);
/// As SampleIdentity::writer_guid has it.
[[nodiscard]] std::array<std::uint8_t, 16> octets_of(const eprosima::fastrtps::rtps::GUID_t& guid);

}  // namespace trammel::wire
