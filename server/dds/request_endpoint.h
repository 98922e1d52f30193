#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <exception>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "idl/transport.h"
#include "server/base/mutex.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"
#include "server/dds/partition_owners.h"
#include "server/dds/reply_channels.h"
#include "server/dds/reply_memory.h"
#include "server/dds/stillness.h"

namespace trammel {

/// What all operations of a service share. Must outlive them.
struct ServiceCore {
  std::string server_id;
  wire::dds::DomainParticipant& participant;
  wire::dds::Subscriber& subscriber;
  Handlers& handlers;
  ReplyChannels& channels;
  const PartitionOwners& owners;
  std::atomic<std::uint64_t> requests{0};     ///< answered
  std::atomic<std::uint64_t> refused{0};      ///< answered with another code than RESULT_OK
  std::atomic<std::uint64_t> shed{0};         ///< answered with RESULT_BUSY or RESULT_DEADLINE_MISSED
  std::atomic<std::uint64_t> unheard{0};      ///< answered after the client had left
  std::atomic<std::uint64_t> misdirected{0};  ///< not answered: the reply partition is another client's
  /// Not answered: not even the header could be read.
  std::shared_ptr<std::atomic<std::uint64_t>> unreadable = std::make_shared<std::atomic<std::uint64_t>>(0);
  WorkUnderWay taking{};  ///< takes of requests from DDS readers
  WorkUnderWay replying{};
};

class RequestEndpointBase {
 public:
  virtual ~RequestEndpointBase() = default;
  /// Name of the operation.
  [[nodiscard]] virtual const char* name() const = 0;
  /// For the watchdog: a number while requests are waiting and an idle worker has not looked for them; else empty. The
  /// number is how many requests had come when a worker last looked. Takes no lock.
  [[nodiscard]] virtual std::optional<std::uint64_t> unseen() const = 0;
};

/// Of a request that claims to be of another DDS writer than the one that sent it.
[[nodiscard]] inline std::optional<wire::Fault> fault_of_identity(const wire::RequestHeader& header,
                                                                  const eprosima::fastrtps::rtps::GUID_t& writer) {
  if (header.request_id().writer_guid() == wire::octets_of(writer)) return std::nullopt;
  return wire::Fault{wire::RESULT_WRONG_IDENTITY,
                     "request_id must hold the GUID of the writer that sends it",
                     {},
                     "writer_guid",
                     {},
                     {}};
}

/// Whose answer it is, and to which request.
inline void put_identity(const wire::RequestHeader& asked, const std::string& server_id, wire::ReplyHeader& reply) {
  reply.related_request_id(asked.request_id());
  reply.server(server_id);
  reply.contract_version(wire::CONTRACT_VERSION);
  reply.trace_id(asked.trace_id());
}

/// The reply to a request that cannot be carried out.
template <typename Reply>
[[nodiscard]] Reply refusal_of(const wire::RequestHeader& asked, const wire::Fault& fault,
                               const std::string& server_id) {
  Reply reply;
  put_error(fault, reply.header());
  put_identity(asked, server_id, reply.header());
  return reply;
}

/// The reply to a request, with its header: from the handler, or from `memory` for a repeat.
template <typename Request, typename Reply>
[[nodiscard]] Reply reply_to(const Request& request, Handlers& handlers, ReplyMemory<Reply>& memory,
                             const std::string& server_id) {
  const wire::RequestHeader& asked = request.header();
  const std::string id = request_id_text(asked.request_id());
  const bool once = happens_once(request);
  if (once) {
    if (auto known = memory.find(id)) return std::move(*known);
  }

  Reply reply;
  try {
    Result<Reply> answer = handlers.answer(request);
    if (answer) {
      reply = std::move(*answer);
    } else {
      put_error(answer.error(), reply.header());
    }
  } catch (const std::exception& failed) {
    reply = Reply();
    put_error(wire::Fault{wire::RESULT_UNKNOWN_EXCEPTION, failed.what(), {}, {}, {}, {}}, reply.header());
  }
  put_identity(asked, server_id, reply.header());
  if (once && reply.header().result() == wire::RESULT_OK) memory.remember(id, reply);
  return reply;
}

/// One operation: its DDS reader, and the worker threads that take requests, answer them and send the replies. The DDS
/// listener only wakes the workers.
template <typename Operation>
class RequestEndpoint final : public RequestEndpointBase, private wire::dds::DataReaderListener {
 public:
  using Request = typename Operation::Request::type;
  using Reply = typename Operation::Reply::type;

  [[nodiscard]] static Result<std::unique_ptr<RequestEndpointBase>> open(ServiceCore& core, int workers) {
    std::unique_ptr<RequestEndpoint> endpoint(new RequestEndpoint(core));
    const auto request_topic = wire::make_received_topic<Operation>(core.participant, core.unreadable);
    if (!request_topic) return tl::make_unexpected(request_topic.error());
    const auto reply_topic = wire::make_reply_topic<Operation>(core.participant);
    if (!reply_topic) return tl::make_unexpected(reply_topic.error());
    endpoint->reply_topic_ = *reply_topic;
    core.channels.add_topic(*reply_topic);
    endpoint->reader_ = core.subscriber.create_datareader(*request_topic, wire::call_reader_qos(wire::kRequestDepth),
                                                          endpoint.get(), wire::dds::StatusMask::data_available());
    if (endpoint->reader_ == nullptr) {
      return failure(ErrorCode::kInternal, "cannot create the reader of {} requests", Operation::kName);
    }
    for (int i = 0; i < workers; ++i) {
      endpoint->workers_.emplace_back([e = endpoint.get()](const std::stop_token& stop) { e->work(stop); });
    }
    return endpoint;
  }

  const char* name() const override { return Operation::kName; }
  std::optional<std::uint64_t> unseen() const override {
    const std::uint64_t looked = looked_;
    if (arrivals_ == looked || idle_ == 0) return std::nullopt;
    return looked;
  }

  ~RequestEndpoint() override {
    for (std::jthread& worker : workers_) worker.request_stop();
    workers_.clear();
    if (reader_ != nullptr) core_.subscriber.delete_datareader(reader_);
  }

 private:
  static constexpr std::size_t kRepliesRemembered = 1024;
  static constexpr std::size_t kMemoryKept = 65536;  // bytes of a request whose memory serves for the next one
  static constexpr std::size_t kLately = 32;         // kept replies; those with many targets are large
  /// Whether an answer takes long to compute. Then a repeat gets the kept reply.
  static constexpr bool kComputes =
      std::is_same_v<Operation, wire::PredictError> || std::is_same_v<Operation, wire::CorrectTarget>;

  explicit RequestEndpoint(ServiceCore& core) : core_(core), memory_(kRepliesRemembered), lately_(kLately) {}

  void on_data_available(wire::dds::DataReader*) override {
    {
      const MutexLock lock(mutex_);
      ++arrivals_;
    }
    arrived_.notify_one();
  }

  void work(const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "requests");
    wire::Received<Request> request;
    wire::dds::SampleInfo info;
    while (!stop.stop_requested()) {
      MutexLock lock(mutex_);
      const std::uint64_t seen = arrivals_;
      lock.unlock();
      while (!stop.stop_requested() && take(request, info)) {
        if (info.valid_data) serve(request, info.sample_identity.writer_guid(), stop);
        if (request.bytes > kMemoryKept) request = {};
      }
      ++idle_;
      lock.lock();
      arrived_.wait(lock, stop, [&] { return arrivals_ != seen; });
      --idle_;
    }
  }

  bool take(wire::Received<Request>& request, wire::dds::SampleInfo& info) {
    const WorkUnderWay::Piece piece = core_.taking.begin();
    looked_ = arrivals_.load();
    return reader_->take_next_sample(&request, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
  }

  void serve(const wire::Received<Request>& request, const eprosima::fastrtps::rtps::GUID_t& writer,
             const std::stop_token& stop) {
    const std::string wanted = request.header().server().to_string();
    if (!wanted.empty() && wanted != core_.server_id) return;
    const std::string partition = request.header().reply_partition().to_string();
    if (!core_.owners.may_use(partition, wire::participant_of(writer))) {
      ++core_.misdirected;
      return;
    }
    // Keyed by the DDS writer of the sample, not by the id in the request: clients may reuse their ids.
    const std::string sent = wire::participant_of(writer) +
                             std::string(reinterpret_cast<const char*>(writer.entityId.value), writer.entityId.size) +
                             request_id_text(request.header().request_id());
    UnderWay::Piece answering(under_way_, sent);
    if (!answering.is_first()) return;
    std::optional<Reply> known = lately_.find(sent);
    const std::optional<wire::Fault> fault =
        request.fault ? request.fault : fault_of_identity(request.header(), writer);
    Reply reply = known   ? std::move(*known)
                  : fault ? refusal_of<Reply>(request.header(), *fault, core_.server_id)
                          : reply_to<Request, Reply>(request, core_.handlers, memory_, core_.server_id);
    if (kComputes && !known && reply.header().result() == wire::RESULT_OK) lately_.remember(sent, reply);
    ++core_.requests;
    const wire::ResultCode result = reply.header().result();
    if (result != wire::RESULT_OK) ++core_.refused;
    if (result == wire::RESULT_BUSY || result == wire::RESULT_DEADLINE_MISSED) ++core_.shed;
    const WorkUnderWay::Piece piece = core_.replying.begin();
    do {
      if (!core_.channels.send(partition, reply_topic_, &reply, stop)) ++core_.unheard;
    } while (answering.has_repeat());
  }

  ServiceCore& core_;
  wire::dds::Topic* reply_topic_ = nullptr;
  wire::dds::DataReader* reader_ = nullptr;
  ReplyMemory<Reply> memory_;  // replies of operations that change something
  ReplyMemory<Reply> lately_;  // replies of long computations
  UnderWay under_way_;
  Mutex mutex_;  // no arrival may fall between the check of arrivals_ and the wait
  Condition arrived_;
  std::atomic<std::uint64_t> arrivals_{0};  // counted under mutex_
  std::atomic<std::uint64_t> looked_{0};    // value of arrivals_ when a worker last began to take
  std::atomic<int> idle_{0};                // workers that wait for arrivals
  std::vector<std::jthread> workers_;
};

}  // namespace trammel
