#include "server/dds/ros2/ros2_endpoint.h"

#include <pthread.h>

#include <chrono>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <list>
#include <map>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "idl/transport/ros2.h"
#include "server/base/mutex.h"
#include "server/dds/ros2/translated.h"
#include "server/dds/schedule/outbox.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;

/// Writes answers to all nodes, once the asking node listens: its reader may be matched a little
/// later than its writer, and a reader misses earlier samples. Thread-safe.
template <typename Ros>
class Ros2Replies final : public ReplySink, private wire::dds::DataWriterListener {
 public:
  using Reply = typename Ros::Operation::Reply::type;
  using Message = typename Ros::Reply::type;

  [[nodiscard]] static Result<std::unique_ptr<Ros2Replies>> open(ServiceCore& core,
                                                                 WorkUnderWay& writing) {
    const auto topic =
        TRY(wire::make_topic(core.participant, Ros::kReplyTopic,
                             new wire::SafeType<typename Ros::Reply>(Ros::Operation::kMaxSample)));
    std::unique_ptr<Ros2Replies> replies(new Ros2Replies(core, writing));
    replies->publisher_ = core.participant.create_publisher(wire::publisher_qos({}));
    if (replies->publisher_ != nullptr)
      replies->writer_ = replies->publisher_->create_datawriter(
          topic, wire::call_writer_qos(wire::kReplyDepth), replies.get(),
          wire::dds::StatusMask::publication_matched());
    if (replies->writer_ == nullptr)
      return failure(ErrorCode::kInternal, "cannot create the writer of {}", Ros::kReplyTopic);
    replies->start();
    return replies;
  }

  ~Ros2Replies() override {
    thread_ = {};
    if (writer_ != nullptr) publisher_->delete_datawriter(writer_);
    if (publisher_ != nullptr) core_.participant.delete_publisher(publisher_);
  }
  Ros2Replies(const Ros2Replies&) = delete;
  Ros2Replies& operator=(const Ros2Replies&) = delete;

  void send(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override {
    if (listens(to.participant)) return write(reply.get());
    post(to, std::move(reply), bytes);
  }

  /// A reply without room is dropped: so many replies wait only if nodes ask faster than they can
  /// be answered.
  void post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override {
    {
      const MutexLock lock(mutex_);
      static_cast<void>(waiting_.put(
          {to.participant, {}, to.topic, std::move(reply), bytes, Clock::now() + kReplyPatience}));
      has_news_ = true;
    }
    due_.notify_all();
  }

 private:
  static constexpr std::size_t kWrittenAtOnce = 64;
  static constexpr std::chrono::milliseconds kLook{500};  // period of the search for expired
                                                          // replies

  Ros2Replies(ServiceCore& core, WorkUnderWay& writing)
      : core_(core), writing_(writing), waiting_(OutboxLimits{}) {}

  void on_publication_matched(wire::dds::DataWriter*,
                              const wire::dds::PublicationMatchedStatus& status) override {
    const auto reader = eprosima::fastrtps::rtps::iHandle2GUID(status.last_subscription_handle);
    {
      const MutexLock lock(mutex_);
      const auto entry = readers_.try_emplace(wire::participant_of(reader), 0).first;
      entry->second += status.current_count_change;
      if (entry->second <= 0) readers_.erase(entry);
      has_news_ = true;
    }
    due_.notify_all();
  }

  [[nodiscard]] bool listens(const std::string& participant) const {
    const MutexLock lock(mutex_);
    return readers_.contains(participant);
  }

  void start() {
    thread_ = std::jthread([this](const std::stop_token& stop) {
      ::pthread_setname_np(::pthread_self(), "ros2 replies");
      while (!stop.stop_requested()) {
        for (const Parcel& parcel : wait_for_due(stop)) write(parcel.reply.get());
      }
    });
  }

  /// The process that asks may be another one than the process that hears the answer. After a while
  /// the answer is therefore written in any case.
  [[nodiscard]] std::list<Parcel> wait_for_due(const std::stop_token& stop) {
    MutexLock lock(mutex_);
    due_.wait_for(lock, stop, kLook, [this]() TRAMMEL_REQUIRES(mutex_) { return has_news_; });
    const auto now = Clock::now();
    auto due = waiting_.take(kWrittenAtOnce, [&](const Parcel& one) TRAMMEL_REQUIRES(mutex_) {
      return one.until <= now || readers_.contains(one.client);
    });
    has_news_ = due.size() == kWrittenAtOnce;
    return due;
  }

  void write(const void* reply) {
    const WorkUnderWay::Piece piece = writing_.begin();
    Message message = ros2::answered(*static_cast<const Reply*>(reply), core_.trainer.cells());
    if (writer_->write(&message)) return;
    Message error;
    error.id(message.id());
    error.server(core_.server_id);
    error.result(wire::RESULT_INTERNAL);
    error.message("the answer does not fit on the wire; ask for less of it");
    writer_->write(&error);
  }

  ServiceCore& core_;
  WorkUnderWay& writing_;
  wire::dds::Publisher* publisher_ = nullptr;
  wire::dds::DataWriter* writer_ = nullptr;
  mutable Mutex mutex_;
  Condition due_;
  Outbox waiting_ TRAMMEL_GUARDED_BY(mutex_);
  std::map<std::string, int> readers_ TRAMMEL_GUARDED_BY(mutex_);  // matched, of each participant
  bool has_news_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::jthread thread_;
};

template <typename Ros>
class Ros2Endpoint final : public RequestEndpointBase, private wire::dds::DataReaderListener {
 public:
  using Operation = typename Ros::Operation;
  using Message = wire::ReceivedMessage<typename Ros::Request::type>;

  [[nodiscard]] static Result<std::unique_ptr<RequestEndpointBase>> open(ServiceCore& core,
                                                                         Lane& lane,
                                                                         WorkUnderWay& writing) {
    const auto topic = TRY(wire::make_topic(core.participant, Ros::kRequestTopic,
                                            new wire::ReceivedMessageType<typename Ros::Request>(
                                                Operation::kMaxSample, core.unreadable)));
    auto replies = TRY(Ros2Replies<Ros>::open(core, writing));
    std::unique_ptr<Ros2Endpoint> endpoint(new Ros2Endpoint(core, lane, std::move(replies)));
    const auto heard = wire::dds::StatusMask::data_available()
                       << wire::dds::StatusMask::sample_lost();
    endpoint->reader_ = core.subscriber.create_datareader(
        topic, wire::call_reader_qos(wire::kRequestDepth), endpoint.get(), heard);
    if (endpoint->reader_ == nullptr)
      return failure(ErrorCode::kInternal, "cannot create the reader of {}", Ros::kRequestTopic);
    return endpoint;
  }

  ~Ros2Endpoint() override { close(); }

  void close() override {
    if (reader_ != nullptr) core_.subscriber.delete_datareader(reader_);
    reader_ = nullptr;
  }

  OperationFigures figures() const override {
    return {Ros::kName, context_.operation.latency(), by_result_words(context_.operation)};
  }

 private:
  Ros2Endpoint(ServiceCore& core, Lane& lane, std::unique_ptr<Ros2Replies<Ros>> replies)
      : core_(core),
        lane_(lane),
        replies_(std::move(replies)),
        context_{core.server_id, Ros::kReplyTopic, core.handlers, *replies_, core.counts} {
    context_.listener = core.listener;
    context_.recorder = core.recorder;
  }

  void on_data_available(wire::dds::DataReader* reader) override {
    wire::dds::SampleInfo info;
    Message message;
    while (take(*reader, message, info)) {
      if (info.valid_data) receive(message, info.sample_identity.writer_guid());
    }
  }

  void on_sample_lost(wire::dds::DataReader*, const wire::dds::SampleLostStatus& status) override {
    core_.counts.lost += static_cast<std::uint64_t>(status.total_count_change);
  }

  bool take(wire::dds::DataReader& reader, Message& message, wire::dds::SampleInfo& info) {
    const WorkUnderWay::Piece piece = core_.taking.begin();
    return reader.take_next_sample(&message, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
  }

  /// In the thread that receives all requests: it must not wait, nor write.
  void receive(const Message& message, const eprosima::fastrtps::rtps::GUID_t& writer) {
    if (!message.server().empty() && message.server() != core_.server_id) return;
    auto request = ros2::asked(message, core_.trainer.cells());
    request->header().request_id().writer_guid(wire::octets_of(writer));
    const ReplyAddress to{wire::participant_of(writer), {}, context_.reply_topic};
    const std::string sent =
        to.participant +
        std::string(reinterpret_cast<const char*>(writer.entityId.value), writer.entityId.size) +
        message.id();
    Ask ask = ask_of<Operation>(core_.trainer, *request, to.participant);
    const auto call =
        std::make_shared<Call<Operation>>(context_, std::move(request), to, sent, nullptr);
    if (call->is_answered_for_its_id() || !call->is_first()) return;
    if (const auto shed = lane_.submit(call, std::move(ask))) call->shed(*shed);
  }

  ServiceCore& core_;
  Lane& lane_;
  const std::unique_ptr<Ros2Replies<Ros>> replies_;
  CallContext<Operation> context_;
  wire::dds::DataReader* reader_ = nullptr;
};

}  // namespace

template <typename Ros>
Result<std::unique_ptr<RequestEndpointBase>> open_ros2_endpoint(ServiceCore& core, Lane& lane,
                                                                WorkUnderWay& writing) {
  return Ros2Endpoint<Ros>::open(core, lane, writing);
}

template Result<std::unique_ptr<RequestEndpointBase>> open_ros2_endpoint<wire::Ros2PredictErrors>(
    ServiceCore&, Lane&, WorkUnderWay&);
template Result<std::unique_ptr<RequestEndpointBase>> open_ros2_endpoint<wire::Ros2CorrectTargets>(
    ServiceCore&, Lane&, WorkUnderWay&);

}  // namespace trammel
