#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "idl/exchange/wire_told.h"
#include "server/dds/client_names.h"
#include "server/dds/gateway/service_calls.h"
#include "server/dds/gateway/waiting_replies.h"
#include "server/dds/request_endpoint.h"

namespace trammel {

/// The clients of a gateway as the service knows clients: each is a participant of its own, with
/// the name that the gateway found. Their ids begin with a secret of this process, so that nobody
/// on the network can take one.
class LocalClients {
 public:
  explicit LocalClients(ClientNames& names);
  /// The 12 octets that begin the GUIDs of a participant.
  [[nodiscard]] std::string participant_of(const std::string& client);

 private:
  ClientNames& names_;
  const std::uint64_t secret_;
};

/// The parts that the endpoints of a gateway share. They outlive them.
struct LocalCore {
  ServiceCore& service;
  LocalClients& clients;
  WaitingReplies& replies;
};

/// One operation for callers in this process. A request takes the way of a sample: it is written as
/// one, and read and checked as one that came over the network (idl/repairs/valid.h).
template <typename Operation>
class LocalEndpoint final : public RequestEndpointBase {
 public:
  using Request = typename Operation::Request::type;
  using Reply = typename Operation::Reply::type;
  using Received = wire::Received<Request>;

  LocalEndpoint(LocalCore& core, Lanes lanes)
      : core_(core),
        lanes_(lanes),
        type_(Operation::kMaxSample, core.service.unreadable),
        context_{core.service.server_id, "http", core.service.handlers, core.replies,
                 core.service.counts} {
    context_.listener = core.service.listener;
    context_.recorder = core.service.recorder;
  }

  void close() override {}  // its callers have left before: see WaitingReplies::close()

  OperationFigures figures() const override {
    return {std::string("Http") + Operation::kName, context_.operation.latency(),
            by_result_words(context_.operation)};
  }

  /// Waits for the answer.
  [[nodiscard]] Result<Reply> ask(Request request, const CallFrom& from, CallOutcome& outcome) {
    const std::string participant = core_.clients.participant_of(from.client);
    const std::string partition = put_header(request.header(), participant, from);
    auto received = std::make_unique<Received>();
    if (const Status fits = as_a_sample(request, *received); !fits)
      return refused(fits.error(), "too_large", outcome);
    core_.replies.expect(partition);
    queue(std::move(received), {participant, partition, context_.reply_topic});
    const auto reply = std::static_pointer_cast<Reply>(
        core_.replies.wait(partition, WaitingReplies::Clock::now() + patience(from)));
    if (!reply)
      return refused(
          failure(ErrorCode::kBusy, "no answer within {} ms, or the service has been asked to stop",
                  patience(from).count())
              .next("ask for the state of what was asked before asking again")
              .value(),
          "deadline_missed", outcome);
    outcome.result = result_word(reply->header().result());
    outcome.retry_after = std::chrono::milliseconds(reply->header().retry_after_ms());
    if (reply->header().result() == wire::RESULT_OK) return std::move(*reply);
    return tl::make_unexpected(wire::error_of(reply->header()));
  }

 private:
  /// Beyond its deadline every request has its answer: a lane sheds what is late.
  [[nodiscard]] static std::chrono::milliseconds patience(const CallFrom& from) {
    constexpr std::chrono::milliseconds kAtMost{120'000}, kAnswering{5000};
    return from.deadline.count() > 0 ? std::min(from.deadline + kAnswering, kAtMost) : kAtMost;
  }

  [[nodiscard]] static Result<Reply> refused(const Error& error, const char* result,
                                             CallOutcome& outcome) {
    outcome.result = result;
    return tl::make_unexpected(error);
  }

  /// Returns the partition, which only this request has.
  std::string put_header(wire::RequestHeader& header, const std::string& participant,
                         const CallFrom& from) {
    const std::int64_t number = ++asked_;
    auto& guid = header.request_id().writer_guid();
    std::fill(guid.begin(), guid.end(), std::uint8_t{0});
    std::copy(participant.begin(), participant.end(), guid.begin());
    header.request_id().sequence_number(number);
    std::string partition = fmt::format("http.{}.{}", Operation::kName, number);
    header.reply_partition(partition);
    header.contract_version(wire::CONTRACT_VERSION);
    header.deadline_ms(static_cast<std::uint32_t>(from.deadline.count()));
    header.trace_id(from.trace);
    return partition;
  }

  [[nodiscard]] Status as_a_sample(Request& request, Received& received) {
    eprosima::fastrtps::rtps::SerializedPayload_t sample(
        type_.getSerializedSizeProvider(&request)());
    if (type_.serialize(&request, &sample) && type_.deserialize(&sample, &received)) return {};
    return failure(ErrorCode::kTooLarge, "the request does not fit into {} bytes",
                   Operation::kMaxSample)
        .next("send less at once");
  }

  void queue(std::unique_ptr<Received> request, const ReplyAddress& to) {
    const std::string sent =
        to.participant + Operation::kName + request_id_text(request->header().request_id());
    Lane& lane = happens_once(*request) ? lanes_.changes : lanes_.reads;
    Ask ask = ask_of<Operation>(core_.service.trainer, *request, to.participant);
    const auto call =
        std::make_shared<Call<Operation>>(context_, std::move(request), to, sent, nullptr);
    if (const auto shed = lane.submit(call, std::move(ask))) call->shed(*shed);
  }

  LocalCore& core_;
  const Lanes lanes_;
  wire::ReceivedType<typename Operation::Request> type_;
  CallContext<Operation> context_;
  std::atomic<std::int64_t> asked_{0};
};

}  // namespace trammel
