#pragma once

#include <chrono>
#include <cstdint>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/transport/transport.h"
#include "server/base/mutex.h"
#include "server/dds/client_names.h"
#include "server/dds/packet_report.h"
#include "server/dds/schedule/channel_book.h"

namespace trammel {

/// A change of a client that discovery has found. For a participant that has left, only
/// `participant` is set.
struct ReaderEvent {
  enum class Kind { kFound, kLost, kLeft } kind;
  ReplyReader reader;
};

/// The events for which the status thread of a service waits. As the participant's listener, it
/// records the readers of replies, the participants that have left, and the names of the admitted
/// ones. Thread-safe.
class ServiceEvents final : public wire::dds::DomainParticipantListener {
 public:
  /// The status is to be published.
  void status_changed();
  /// The status thread has something else to do.
  void wake();

  /// The news since the last call of wait().
  struct News {
    bool status_changed = false;
    std::vector<ReaderEvent> readers = {};
  };
  /// Waits until something has happened, at most `limit`.
  [[nodiscard]] News wait(const std::stop_token& stop, std::chrono::milliseconds limit);

  /// The number of times that participants were refused: one participant tries again and again.
  [[nodiscard]] std::uint64_t refusals() const;
  /// The sentences of StrangerReport that are due by then.
  [[nodiscard]] std::vector<std::string> strangers_due(PacketReport::Time now);
  [[nodiscard]] const ClientNames& names() const { return names_; }
  [[nodiscard]] ClientNames& names() { return names_; }

 private:
  void on_subscriber_discovery(wire::dds::DomainParticipant* participant,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;
  void on_participant_discovery(wire::dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void onParticipantAuthentication(
      wire::dds::DomainParticipant* participant,
      eprosima::fastrtps::rtps::ParticipantAuthenticationInfo&& info) override;

  ClientNames names_;
  mutable Mutex mutex_;
  Condition changed_;
  bool woken_ TRAMMEL_GUARDED_BY(mutex_) = false;
  bool status_changed_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::vector<ReaderEvent> readers_ TRAMMEL_GUARDED_BY(mutex_);
  std::set<std::string> left_ TRAMMEL_GUARDED_BY(mutex_);  // participants
  StrangerReport strangers_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
