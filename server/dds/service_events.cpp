#include "server/dds/service_events.h"

#include <fastrtps/utils/IPLocator.h>

#include <sstream>
#include <utility>

namespace trammel {
namespace {

/// Limit of readers recorded between two calls of wait(), which are some milliseconds apart.
constexpr std::size_t kMaxReaders = 4096;

/// The name that the participant claims; empty: it claims none.
std::string claimed_subject(const eprosima::fastrtps::rtps::IdentityToken& token) {
  for (const auto& property : token.properties()) {
    if (property.name() == "dds.cert.sn") return property.value();
  }
  return {};
}

/// The address that the participant announces; empty: it announces none.
std::string claimed_address(const eprosima::fastrtps::rtps::ParticipantProxyData& participant) {
  for (const auto* locators :
       {&participant.metatraffic_locators.unicast, &participant.default_locators.unicast}) {
    for (const auto& locator : *locators) {
      if (locator.kind == LOCATOR_KIND_UDPv4)
        return eprosima::fastrtps::rtps::IPLocator::toIPv4string(locator);
    }
  }
  return {};
}

}  // namespace

void ServiceEvents::status_changed() {
  {
    const MutexLock lock(mutex_);
    status_changed_ = true;
    woken_ = true;
  }
  changed_.notify_one();
}

void ServiceEvents::wake() {
  {
    const MutexLock lock(mutex_);
    woken_ = true;
  }
  changed_.notify_one();
}

ServiceEvents::News ServiceEvents::wait(const std::stop_token& stop,
                                        std::chrono::milliseconds limit) {
  MutexLock lock(mutex_);
  changed_.wait_for(lock, stop, limit, [this]() TRAMMEL_REQUIRES(mutex_) {
    return woken_ || !readers_.empty() || !left_.empty();
  });
  woken_ = false;
  News news{std::exchange(status_changed_, false), std::exchange(readers_, {})};
  // Last: no participant comes back under the same name.
  for (const std::string& participant : std::exchange(left_, {})) {
    news.readers.push_back({ReaderEvent::Kind::kLeft, {participant, {}, {}}});
  }
  return news;
}

void ServiceEvents::on_subscriber_discovery(wire::dds::DomainParticipant*,
                                            eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) {
  using Info = eprosima::fastrtps::rtps::ReaderDiscoveryInfo;
  if (info.status != Info::DISCOVERED_READER && info.status != Info::REMOVED_READER) return;
  const std::string topic = info.info.topicName().to_string();
  const std::vector<std::string> partitions = info.info.m_qos.m_partition.names();
  if (!topic.ends_with("_Reply") || partitions.size() != 1 ||
      !wire::valid_partition(partitions.front()))
    return;
  const auto kind =
      info.status == Info::REMOVED_READER ? ReaderEvent::Kind::kLost : ReaderEvent::Kind::kFound;
  {
    const MutexLock lock(mutex_);
    if (readers_.size() >= kMaxReaders) return;
    readers_.push_back({kind, {wire::participant_of(info.info.guid()), partitions.front(), topic}});
  }
  changed_.notify_one();
}

void ServiceEvents::on_participant_discovery(
    wire::dds::DomainParticipant*, eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) {
  using Info = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;
  const std::string participant = wire::participant_of(info.info.m_guid);
  if (info.status != Info::REMOVED_PARTICIPANT && info.status != Info::DROPPED_PARTICIPANT) {
    names_.announced(participant, claimed_subject(info.info.identity_token_),
                     claimed_address(info.info));
    return;
  }
  names_.left(participant);
  {
    const MutexLock lock(mutex_);
    left_.insert(participant);
  }
  changed_.notify_one();
}

std::uint64_t ServiceEvents::refusals() const {
  const MutexLock lock(mutex_);
  return strangers_.tries();
}

std::vector<std::string> ServiceEvents::strangers_due(PacketReport::Time now) {
  const MutexLock lock(mutex_);
  return strangers_.due(now);
}

void ServiceEvents::onParticipantAuthentication(
    wire::dds::DomainParticipant*, eprosima::fastrtps::rtps::ParticipantAuthenticationInfo&& info) {
  using Info = eprosima::fastrtps::rtps::ParticipantAuthenticationInfo;
  const std::string participant = wire::participant_of(info.guid);
  if (info.status == Info::AUTHORIZED_PARTICIPANT) {
    names_.let_in(participant);
    return;
  }
  const std::string who = names_.refused(participant);
  std::ostringstream guid;
  guid << info.guid.guidPrefix;
  const MutexLock lock(mutex_);
  strangers_.refused(who, guid.str());
}

}  // namespace trammel
