#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "idl/contract_1.h"
#include "server/base/mutex.h"
#include "server/dds/partition_owners.h"
#include "server/dds/reply_channels.h"

namespace trammel {

/// Tells clients of contract 1, on their own topics, that they must be updated. One thread of its own.
class OldContract final : private wire::dds::DataReaderListener {
 public:
  /// All of these outlive it.
  [[nodiscard]] static Result<std::unique_ptr<OldContract>> open(const std::string& server_id,
                                                                 wire::dds::DomainParticipant& participant,
                                                                 wire::dds::Subscriber& subscriber,
                                                                 ReplyChannels& channels,
                                                                 const PartitionOwners& owners);
  ~OldContract() override;
  OldContract(const OldContract&) = delete;
  OldContract& operator=(const OldContract&) = delete;

 private:
  /// Sends the refusal of a request to the participant that sent it.
  using Refuse = std::function<void(const contract_1::Request&, const std::string& sender)>;
  struct Operation {
    wire::dds::DataReader* reader = nullptr;
    Refuse refuse;
  };

  OldContract(std::string server_id, wire::dds::Subscriber& subscriber, ReplyChannels& channels,
              const PartitionOwners& owners)
      : server_id_(std::move(server_id)), subscriber_(subscriber), channels_(channels), owners_(owners) {}
  template <typename Old>
  [[nodiscard]] Status open_operation(wire::dds::DomainParticipant& participant);
  void on_data_available(wire::dds::DataReader* reader) override;
  void work(const std::stop_token& stop);
  void refuse_all(const Operation& operation, const std::stop_token& stop);

  const std::string server_id_;
  wire::dds::Subscriber& subscriber_;
  ReplyChannels& channels_;
  const PartitionOwners& owners_;
  std::vector<Operation> operations_;
  Mutex mutex_;
  Condition arrived_;
  std::uint64_t arrivals_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::jthread thread_;
};

}  // namespace trammel
