#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <memory>
#include <string>
#include <utility>

#include "idl/transport/transport.h"
#include "server/dds/reply_channels.h"
#include "server/dds/request_call.h"
#include "server/dds/result_words.h"
#include "server/dds/schedule/lane.h"
#include "server/dds/sent_type.h"
#include "server/dds/stillness.h"
#include "server/metrics/service_figures.h"

namespace trammel {

/// The parts that all operations of a service share. They must outlive the operations.
struct ServiceCore {
  std::string server_id;
  wire::dds::DomainParticipant& participant;
  wire::dds::Subscriber& subscriber;
  const Trainer& trainer;  ///< knows which cells are served
  Handlers& handlers;
  ReplyChannels& channels;
  CallListener listener{};
  RequestRecorder* recorder = nullptr;  ///< null: nothing is recorded
  CallCounts counts{};
  /// Dropped: not even the header could be read.
  std::shared_ptr<std::atomic<std::uint64_t>> unreadable =
      std::make_shared<std::atomic<std::uint64_t>>(0);
  WorkUnderWay taking{};  ///< takes of requests from DDS readers
};

/// The queues for requests of an operation: one for changes and one for reading.
struct Lanes {
  Lane& changes;
  Lane& reads;
};

class RequestEndpointBase {
 public:
  virtual ~RequestEndpointBase() = default;
  /// No more requests come in. The lanes must be stopped between this and the destruction.
  virtual void close() = 0;
  [[nodiscard]] virtual OperationFigures figures() const = 0;
};

/// The facts about a request of this participant that the schedule needs.
template <typename Operation, typename Request>
[[nodiscard]] Ask ask_of(const Trainer& trainer, const Request& request,
                         const std::string& participant) {
  /// The waiting time of a request whose client does not state one.
  constexpr std::chrono::milliseconds kPatience{5000};
  const std::string& cell = request.about().cell();
  const bool is_served = trainer.cells().contains(cell);
  Ask ask{participant};
  if (is_served) ask.cell = turn_of(request, cell);
  if (is_served) ask.work = work_of(request, cell, Operation::kName);
  ask.items = items_of(request);
  ask.bytes = bytes_of_request(request);
  const auto now = std::chrono::steady_clock::now();
  const std::chrono::milliseconds deadline(request.header().deadline_ms());
  ask.start_by = now + (deadline.count() > 0 ? deadline : kPatience);
  // A change that has begun is worth its end: a repeat gets the outcome.
  if (deadline.count() > 0 && !happens_once(request)) ask.finish_by = ask.start_by;
  return ask;
}

/// One operation and its DDS reader. The DDS listener takes each request out of the reader at once,
/// so that others cannot push it out, and queues it or has it answered RESULT_BUSY.
template <typename Operation>
class RequestEndpoint final : public RequestEndpointBase, private wire::dds::DataReaderListener {
 public:
  using Request = wire::Received<typename Operation::Request::type>;

  [[nodiscard]] static Result<std::unique_ptr<RequestEndpointBase>> open(ServiceCore& core,
                                                                         Lanes lanes) {
    const auto request_topic =
        wire::make_received_topic<Operation>(core.participant, core.unreadable);
    if (!request_topic) return tl::make_unexpected(request_topic.error());
    const auto reply_topic = make_sent_topic<Operation>(core.participant);
    if (!reply_topic) return tl::make_unexpected(reply_topic.error());
    core.channels.add_topic(*reply_topic, instead_of<typename Operation::Reply::type>);
    std::unique_ptr<RequestEndpoint> endpoint(
        new RequestEndpoint(core, lanes, (*reply_topic)->get_name()));
    const auto heard = wire::dds::StatusMask::data_available()
                       << wire::dds::StatusMask::sample_lost();
    endpoint->reader_ = core.subscriber.create_datareader(
        *request_topic, wire::call_reader_qos(wire::kRequestDepth), endpoint.get(), heard);
    if (endpoint->reader_ == nullptr) {
      return failure(ErrorCode::kInternal, "cannot create the reader of {} requests",
                     Operation::kName);
    }
    return endpoint;
  }

  ~RequestEndpoint() override { close(); }

  void close() override {
    if (reader_ != nullptr) core_.subscriber.delete_datareader(reader_);
    reader_ = nullptr;
  }

  OperationFigures figures() const override {
    return {Operation::kName, context_.operation.latency(), by_result_words(context_.operation)};
  }

 private:
  RequestEndpoint(ServiceCore& core, Lanes lanes, std::string reply_topic)
      : core_(core),
        lanes_(lanes),
        context_{core.server_id, std::move(reply_topic), core.handlers, core.channels,
                 core.counts} {
    context_.listener = core.listener;
    context_.recorder = core.recorder;
  }

  void on_data_available(wire::dds::DataReader* reader) override {
    wire::dds::SampleInfo info;
    auto request = std::make_unique<Request>();
    while (take(*reader, *request, info)) {
      if (!info.valid_data) continue;
      receive(std::move(request), info.sample_identity.writer_guid());
      request = std::make_unique<Request>();
    }
  }

  void on_sample_lost(wire::dds::DataReader*, const wire::dds::SampleLostStatus& status) override {
    core_.counts.lost += static_cast<std::uint64_t>(status.total_count_change);
  }

  bool take(wire::dds::DataReader& reader, Request& request, wire::dds::SampleInfo& info) {
    const WorkUnderWay::Piece piece = core_.taking.begin();
    return reader.take_next_sample(&request, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
  }

  /// In the thread that receives all requests: it must not wait, nor write.
  void receive(std::unique_ptr<Request> request, const eprosima::fastrtps::rtps::GUID_t& writer) {
    const std::string wanted = request->header().server().to_string();
    if (!wanted.empty() && wanted != core_.server_id) return;
    const ReplyAddress to{wire::participant_of(writer),
                          request->header().reply_partition().to_string(), context_.reply_topic};
    auto expectation = core_.channels.expect(to.participant, to.partition);
    if (!expectation) {
      ++core_.counts.misdirected;
      return;
    }
    if (!request->fault) request->fault = fault_of_identity(request->header(), writer);
    const std::string sent =
        to.participant +
        std::string(reinterpret_cast<const char*>(writer.entityId.value), writer.entityId.size) +
        request_id_text(request->header().request_id());
    Lane& lane = happens_once(*request) ? lanes_.changes : lanes_.reads;
    Ask ask = ask_of<Operation>(core_.trainer, *request, to.participant);
    const auto call = std::make_shared<Call<Operation>>(context_, std::move(request), to, sent,
                                                        std::move(expectation));
    if (call->is_answered_for_its_id() || !call->is_first()) return;
    if (const auto shed = lane.submit(call, std::move(ask))) call->shed(*shed);
  }

  ServiceCore& core_;
  const Lanes lanes_;
  CallContext<Operation> context_;
  wire::dds::DataReader* reader_ = nullptr;
};

}  // namespace trammel
