#include "server/dds/old_contract.h"

#include <pthread.h>

#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <utility>

namespace trammel {
namespace {

/// The header of a refusal; the rest of the reply stays empty.
contract_1::ReplyHeader refusal(const contract_1::Request& asked, const std::string& server_id) {
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
                                                       wire::dds::Subscriber& subscriber, ReplyChannels& channels,
                                                       const PartitionOwners& owners) {
  std::unique_ptr<OldContract> old(new OldContract(server_id, subscriber, channels, owners));
  Status opened = old->open_operation<wire::OldPredictError>(participant);
  if (opened) opened = old->open_operation<wire::OldCorrectTarget>(participant);
  if (opened) opened = old->open_operation<wire::OldSubmitMeasurements>(participant);
  if (opened) opened = old->open_operation<wire::OldTrain>(participant);
  if (opened) opened = old->open_operation<wire::OldDiagnose>(participant);
  if (opened) opened = old->open_operation<wire::OldManageModels>(participant);
  if (!opened) return tl::make_unexpected(opened.error());
  old->thread_ = std::jthread([o = old.get()](const std::stop_token& stop) { o->work(stop); });
  return old;
}

OldContract::~OldContract() {
  thread_ = {};
  for (const Operation& operation : operations_) subscriber_.delete_datareader(operation.reader);
}

template <typename Old>
Status OldContract::open_operation(wire::dds::DomainParticipant& participant) {
  const auto requests = wire::make_old_request_topic<Old>(participant);
  if (!requests) return tl::make_unexpected(requests.error());
  const auto replies = wire::make_old_reply_topic<Old>(participant);
  if (!replies) return tl::make_unexpected(replies.error());
  channels_.add_topic(*replies);
  Operation operation;
  operation.refuse = [this, topic = (*replies)->get_name()](const contract_1::Request& request,
                                                            const std::string& sender) {
    const auto reply = std::make_shared<typename Old::Reply::type>();
    reply->header(refusal(request, server_id_));
    channels_.send({sender, request.reply_partition().to_string(), topic}, reply, sizeof *reply);
  };
  operation.reader = subscriber_.create_datareader(*requests, wire::call_reader_qos(wire::kRequestDepth), this,
                                                   wire::dds::StatusMask::data_available());
  if (operation.reader == nullptr)
    return failure(ErrorCode::kInternal, "cannot create the reader of old {} requests", Old::kName);
  operations_.push_back(std::move(operation));
  return {};
}

void OldContract::on_data_available(wire::dds::DataReader*) {
  {
    const MutexLock lock(mutex_);
    ++arrivals_;
  }
  arrived_.notify_one();
}

void OldContract::work(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "old contract");
  while (!stop.stop_requested()) {
    MutexLock lock(mutex_);
    const std::uint64_t seen = arrivals_;
    lock.unlock();
    for (const Operation& operation : operations_) refuse_all(operation, stop);
    lock.lock();
    arrived_.wait(lock, stop, [&]() TRAMMEL_REQUIRES(mutex_) { return arrivals_ != seen; });
  }
}

void OldContract::refuse_all(const Operation& operation, const std::stop_token& stop) {
  contract_1::Request request;
  wire::dds::SampleInfo info;
  while (!stop.stop_requested() &&
         operation.reader->take_next_sample(&request, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    const std::string wanted = request.server().to_string();
    const std::string partition = request.reply_partition().to_string();
    const std::string sender = wire::participant_of(info.sample_identity.writer_guid());
    const bool for_us = wanted.empty() || wanted == server_id_;
    if (info.valid_data && for_us && wire::valid_partition(partition) && owners_.may_use(partition, sender))
      operation.refuse(request, sender);
  }
}

}  // namespace trammel
