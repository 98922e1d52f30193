#pragma once

#include <chrono>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/transport.h"
#include "server/base/mutex.h"

namespace trammel {

/// A client's reader of replies, as discovery found it.
struct ReplyReader {
  std::string topic;
  std::string partition;
};

/// What the status thread of a service waits for. As the participant's listener it notes reply readers and nothing
/// else. Thread-safe.
class ServiceEvents final : public wire::dds::DomainParticipantListener {
 public:
  void status_changed();
  /// Until the status has changed or readers have been found, at most `limit`; the readers found since the last call.
  [[nodiscard]] std::vector<ReplyReader> wait(const std::stop_token& stop, std::chrono::milliseconds limit);

 private:
  void on_subscriber_discovery(wire::dds::DomainParticipant* participant,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;

  Mutex mutex_;
  Condition changed_;
  bool status_changed_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::vector<ReplyReader> readers_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
