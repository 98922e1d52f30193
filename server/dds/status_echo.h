#pragma once

#include <atomic>
#include <cstdint>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <memory>
#include <string>

#include "idl/transport.h"

namespace trammel {

/// Hears what a server publishes of itself: each status went out through its writer, over the network, lost there and
/// sent again, and in through the thread that receives requests too.
class StatusEcho final : private wire::dds::DataReaderListener {
 public:
  /// `writer` is the server's own, of ServiceStatus, in `participant`; `heard` of that participant loses what it writes
  /// once.
  [[nodiscard]] static Result<std::unique_ptr<StatusEcho>> open(wire::dds::DomainParticipant& participant,
                                                                wire::dds::Subscriber& subscriber,
                                                                const wire::dds::DataWriter& writer,
                                                                wire::HeardOfItself& heard);
  ~StatusEcho() override;
  StatusEcho(const StatusEcho&) = delete;
  StatusEcho& operator=(const StatusEcho&) = delete;

  /// Own ones.
  [[nodiscard]] std::uint64_t heard() const { return heard_; }

 private:
  StatusEcho(wire::dds::Subscriber& subscriber, std::string self) : subscriber_(subscriber), self_(std::move(self)) {}
  void on_data_available(wire::dds::DataReader* reader) override;

  wire::dds::Subscriber& subscriber_;
  const std::string self_;  // of all its endpoints, see participant_of()
  wire::dds::DataReader* reader_ = nullptr;
  std::atomic<std::uint64_t> heard_{0};
};

}  // namespace trammel
