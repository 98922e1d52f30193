#pragma once

#include <chrono>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/transport.h"
#include "server/base/mutex.h"
#include "server/dds/partition_owners.h"

namespace trammel {

/// A client's reader of replies, as discovery found it.
struct ReplyReader {
  std::string topic;
  std::string partition;
};

/// What the status thread of a service waits for. As the participant's listener it notes reply readers and whose they
/// are, and nothing else. Thread-safe.
class ServiceEvents final : public wire::dds::DomainParticipantListener {
 public:
  [[nodiscard]] const PartitionOwners& owners() const { return owners_; }
  void status_changed();
  /// Waits until the status has changed or readers have been found, at most `limit`. Returns the readers found since
  /// the last call.
  [[nodiscard]] std::vector<ReplyReader> wait(const std::stop_token& stop, std::chrono::milliseconds limit);

 private:
  void on_subscriber_discovery(wire::dds::DomainParticipant* participant,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;

  PartitionOwners owners_;
  Mutex mutex_;
  Condition changed_;
  bool status_changed_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::vector<ReplyReader> readers_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
