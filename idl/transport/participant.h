#pragma once

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <chrono>
#include <cstdint>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <memory>
#include <string>

#include "server/base/result.h"

/// The settings of every participant of ours, whatever it is for.
namespace trammel::wire {

namespace dds = eprosima::fastdds::dds;

struct ParticipantDeleter {
  void operator()(dds::DomainParticipant* participant) const;  ///< with all that it contains
};
using ParticipantPtr = std::unique_ptr<dds::DomainParticipant, ParticipantDeleter>;

/// UDPv4 on one interface, unicast only. Sets up the library first: it ignores the environment.
/// Refuses an address that this host does not have now: such a participant would receive nothing
/// even after the interface comes up.
[[nodiscard]] Result<std::shared_ptr<eprosima::fastdds::rtps::UDPv4TransportDescriptor>> udp_on(
    const std::string& address);

/// `transport` alone, listening on `address`; our lease and announcements. `listen_port`: 0 = any.
[[nodiscard]] dds::DomainParticipantQos participant_qos(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> transport,
    const std::string& address, std::uint16_t listen_port);

void set_user_data(dds::DomainParticipantQos& qos, const std::string& text);
[[nodiscard]] eprosima::fastrtps::rtps::Locator_t locator(const std::string& address,
                                                          std::uint16_t port);
[[nodiscard]] eprosima::fastrtps::Duration_t to_duration(std::chrono::milliseconds time);

}  // namespace trammel::wire
