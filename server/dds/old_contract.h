#pragma once

#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "idl/contract_1.h"
#include "server/dds/reply_channels.h"

namespace trammel {

/// Tells clients of contract 1, on their own topics, that they must be updated.
class OldContract final : private wire::dds::DataReaderListener {
 public:
  /// All of these outlive it.
  [[nodiscard]] static Result<std::unique_ptr<OldContract>> open(const std::string& server_id,
                                                                 wire::dds::DomainParticipant& participant,
                                                                 wire::dds::Subscriber& subscriber,
                                                                 ReplyChannels& channels);
  ~OldContract() override;
  OldContract(const OldContract&) = delete;
  OldContract& operator=(const OldContract&) = delete;

 private:
  /// The refusal of a request, as a reply of its operation.
  using Refusal = std::function<std::shared_ptr<void>(const contract_1::Request&)>;
  struct Operation {
    std::string reply_topic;
    Refusal refusal;
  };

  OldContract(std::string server_id, wire::dds::Subscriber& subscriber, ReplyChannels& channels)
      : server_id_(std::move(server_id)), subscriber_(subscriber), channels_(channels) {}
  template <typename Old>
  [[nodiscard]] Status add_operation(wire::dds::DomainParticipant& participant);
  [[nodiscard]] Status open_readers();
  /// In the thread that receives all requests: it neither waits nor writes.
  void on_data_available(wire::dds::DataReader* reader) override;

  const std::string server_id_;
  wire::dds::Subscriber& subscriber_;
  ReplyChannels& channels_;
  std::map<wire::dds::Topic*, Operation> operations_;  // by topic of requests; complete before the first reader is made
  std::vector<wire::dds::DataReader*> readers_;
};

}  // namespace trammel
