#include "server/dds/service_events.h"

#include <utility>

namespace trammel {
namespace {

/// Limit of readers noted between two calls of wait(). Clients beyond it get their channel with their first request.
constexpr std::size_t kMaxReaders = 4096;

}  // namespace

void ServiceEvents::status_changed() {
  {
    const MutexLock lock(mutex_);
    status_changed_ = true;
  }
  changed_.notify_one();
}

std::vector<ReplyReader> ServiceEvents::wait(const std::stop_token& stop, std::chrono::milliseconds limit) {
  MutexLock lock(mutex_);
  changed_.wait_for(lock, stop, limit,
                    [this]() TRAMMEL_REQUIRES(mutex_) { return status_changed_ || !readers_.empty(); });
  status_changed_ = false;
  return std::exchange(readers_, {});
}

void ServiceEvents::on_subscriber_discovery(wire::dds::DomainParticipant*,
                                            eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) {
  using Change = eprosima::fastrtps::rtps::ReaderDiscoveryInfo;
  if (info.status == Change::REMOVED_READER) return owners_.left(info.info.guid());
  const std::string topic = info.info.topicName().to_string();
  const std::vector<std::string> partitions = info.info.m_qos.m_partition.names();
  if (!topic.ends_with("_Reply") || partitions.size() != 1 || !wire::valid_partition(partitions.front())) {
    return owners_.left(info.info.guid());
  }
  owners_.found(info.info.guid(), partitions.front());
  if (info.status != Change::DISCOVERED_READER) return;
  {
    const MutexLock lock(mutex_);
    if (readers_.size() < kMaxReaders) readers_.push_back({topic, partitions.front()});
  }
  changed_.notify_one();
}

}  // namespace trammel
