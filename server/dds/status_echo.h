#pragma once

#include <atomic>
#include <cstdint>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <memory>
#include <string>

#include "idl/transport/transport.h"

namespace trammel {

/// Receives the status that the server itself publishes: a test of the whole path. Each status
/// leaves through its writer, crosses the network, is dropped once on purpose (at most twice a
/// second) and sent again, and arrives in the thread that also receives requests.
class StatusEcho final : private wire::dds::DataReaderListener {
 public:
  /// `writer` is the server's writer of ServiceStatus in `participant`. `heard` belongs to that
  /// participant; it is asked to drop the first copy of each sample of `writer`.
  [[nodiscard]] static Result<std::unique_ptr<StatusEcho>> open(
      wire::dds::DomainParticipant& participant, wire::dds::Subscriber& subscriber,
      const wire::dds::DataWriter& writer, wire::HeardOfItself& heard);
  ~StatusEcho() override;
  StatusEcho(const StatusEcho&) = delete;
  StatusEcho& operator=(const StatusEcho&) = delete;

  /// The number of the server's own samples that have arrived.
  [[nodiscard]] std::uint64_t heard() const { return heard_; }

 private:
  StatusEcho(wire::dds::Subscriber& subscriber, std::string self)
      : subscriber_(subscriber), self_(std::move(self)) {}
  void on_data_available(wire::dds::DataReader* reader) override;

  wire::dds::Subscriber& subscriber_;
  const std::string self_;  // id of the participant, see participant_of()
  wire::dds::DataReader* reader_ = nullptr;
  std::atomic<std::uint64_t> heard_{0};
};

}  // namespace trammel
