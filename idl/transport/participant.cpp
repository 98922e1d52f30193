#include "idl/transport/participant.h"

#include <arpa/inet.h>
#include <fastrtps/attributes/LibrarySettingsAttributes.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <netinet/in.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <mutex>
#include <sstream>
#include <utility>

#include "idl/limits.h"
#include "idl/repairs/library_clock.h"
#include "idl/repairs/quiet_library.h"
#include "server/base/host_port.h"
#include "server/base/line_output.h"

namespace trammel::wire {
namespace {

namespace rtps = eprosima::fastrtps::rtps;

constexpr std::uint32_t kSocketBuffer = 4u << 20;
constexpr std::uint32_t kPortTries = 2000;

/// The library's errors to standard error, which nobody may read any more: the library does not
/// wait for that.
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
    start_library_clock();
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
    return failure(ErrorCode::kUsage,
                   "address {} is not one of this host's, or its interface is down", address)
        .next(fmt::format("it has {}", fmt::join(own, ", ")));
  }
  return {};
}

}  // namespace

void ParticipantDeleter::operator()(dds::DomainParticipant* participant) const {
  participant->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant);
}

eprosima::fastrtps::Duration_t to_duration(std::chrono::milliseconds time) {
  return {static_cast<std::int32_t>(time.count() / 1000),
          static_cast<std::uint32_t>(time.count() % 1000) * 1'000'000u};
}

rtps::Locator_t locator(const std::string& address, std::uint16_t port) {
  rtps::Locator_t result;
  rtps::IPLocator::createLocator(LOCATOR_KIND_UDPv4, address, port, result);
  return result;
}

Result<std::shared_ptr<eprosima::fastdds::rtps::UDPv4TransportDescriptor>> udp_on(
    const std::string& address) {
  set_up_process();
  TRY(check_address(address));
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {address};
  udp->sendBufferSize = kSocketBuffer;
  udp->receiveBufferSize = kSocketBuffer;
  return udp;
}

dds::DomainParticipantQos participant_qos(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> transport,
    const std::string& address, std::uint16_t listen_port) {
  dds::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports = {std::move(transport)};
  qos.transport().send_socket_buffer_size = kSocketBuffer;
  qos.transport().listen_socket_buffer_size = kSocketBuffer;
  auto& builtin = qos.wire_protocol().builtin;
  builtin.discovery_config.leaseDuration = to_duration(kLease);
  builtin.discovery_config.leaseDuration_announcementperiod = to_duration(kAnnouncement);
  // Each participant of a host takes the next free ports. With the library's 100 tries the 125th
  // has none, and is deaf.
  builtin.mutation_tries = kPortTries;
  // A list of its own, even without a port, keeps the participant from joining the default
  // multicast group.
  builtin.metatrafficUnicastLocatorList.push_back(locator(address, listen_port));
  return qos;
}

void set_user_data(dds::DomainParticipantQos& qos, const std::string& text) {
  qos.user_data().setValue(std::vector<unsigned char>(text.begin(), text.end()));
}

}  // namespace trammel::wire
