#include "server/dds/old_contract.h"

#include <algorithm>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

namespace trammel {
namespace {

/// The header of a refusal; the rest of the reply stays empty.
contract_1::ReplyHeader refusal_of(const contract_1::Request& asked, const std::string& server_id) {
  contract_1::ReplyHeader header;
  header.related_request_id(asked.request_id());
  header.result(contract_1::RESULT_WRONG_CONTRACT);
  header.message(wire::fault_of_contract(asked.contract_version()).what);
  header.server(server_id);
  header.contract_version(wire::CONTRACT_VERSION);
  return header;
}

}  // namespace

Result<std::unique_ptr<OldContract>> OldContract::open(const std::string& server_id,
                                                       wire::dds::DomainParticipant& participant,
                                                       wire::dds::Subscriber& subscriber, ReplyChannels& channels) {
  std::unique_ptr<OldContract> old(new OldContract(server_id, subscriber, channels));
  Status opened = old->add_operation<wire::OldPredictError>(participant);
  if (opened) opened = old->add_operation<wire::OldCorrectTarget>(participant);
  if (opened) opened = old->add_operation<wire::OldSubmitMeasurements>(participant);
  if (opened) opened = old->add_operation<wire::OldTrain>(participant);
  if (opened) opened = old->add_operation<wire::OldDiagnose>(participant);
  if (opened) opened = old->add_operation<wire::OldManageModels>(participant);
  if (opened) opened = old->open_readers();
  if (!opened) return tl::make_unexpected(opened.error());
  return old;
}

OldContract::~OldContract() {
  for (wire::dds::DataReader* reader : readers_) subscriber_.delete_datareader(reader);
}

template <typename Old>
Status OldContract::add_operation(wire::dds::DomainParticipant& participant) {
  const auto requests = TRY(wire::make_old_request_topic<Old>(participant));
  const auto replies = TRY(wire::make_old_reply_topic<Old>(participant));
  channels_.add_topic(replies, nullptr);
  operations_[requests] = {replies->get_name(), [this](const contract_1::Request& request) {
                             const auto reply = std::make_shared<typename Old::Reply::type>();
                             reply->header(refusal_of(request, server_id_));
                             return std::shared_ptr<void>(reply);
                           }};
  return {};
}

Status OldContract::open_readers() {
  for (const auto& [topic, operation] : operations_) {
    readers_.push_back(subscriber_.create_datareader(topic, wire::call_reader_qos(wire::kRequestDepth), this,
                                                     wire::dds::StatusMask::data_available()));
    if (readers_.back() == nullptr) {
      readers_.pop_back();
      return failure(ErrorCode::kInternal, "cannot create the reader of {}", topic->get_name());
    }
  }
  return {};
}

void OldContract::on_data_available(wire::dds::DataReader* reader) {
  constexpr std::size_t kBytes = 1024;  // of a refusal in memory, about
  const auto found = std::find_if(operations_.begin(), operations_.end(), [&](const auto& entry) {
    return static_cast<const wire::dds::TopicDescription*>(entry.first) == reader->get_topicdescription();
  });
  contract_1::Request request;
  wire::dds::SampleInfo info;
  while (reader->take_next_sample(&request, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    const std::string wanted = request.server().to_string();
    const std::string partition = request.reply_partition().to_string();
    const bool for_us = wanted.empty() || wanted == server_id_;
    if (!info.valid_data || !for_us || !wire::valid_partition(partition)) continue;
    const ReplyAddress to{wire::participant_of(info.sample_identity.writer_guid()), partition,
                          found->second.reply_topic};
    if (const auto expectation = channels_.expect(to.participant, partition))
      channels_.post(to, found->second.refusal(request), kBytes);
  }
}

}  // namespace trammel
