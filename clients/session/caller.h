#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "clients/session/server_watch.h"
#include "idl/transport.h"
#include "server/base/mutex.h"

namespace trammel::client {

/// To which server a call goes, and how it is repeated.
struct Route {
  std::string cell;                ///< preferred: a server that serves this cell
  std::string server;              ///< only to this one; empty: any
  bool changes_something = false;  ///< a repeat goes to the same server if it can: that one recognises it
};

/// One operation of a session: a request writer, a reply reader in the session's partition, and the calls that wait.
/// Thread-safe; calls overlap.
template <typename Operation>
class Caller final : private wire::dds::DataWriterListener, private wire::dds::DataReaderListener {
 public:
  using Request = typename Operation::Request::type;
  using Reply = typename Operation::Reply::type;

  [[nodiscard]] static Result<std::unique_ptr<Caller>> open(wire::dds::DomainParticipant& participant,
                                                            wire::dds::Publisher& publisher,
                                                            wire::dds::Subscriber& subscriber,
                                                            const std::string& partition, ServerWatch& watch) {
    std::unique_ptr<Caller> caller(new Caller(publisher, subscriber, partition, watch));
    const auto reply_topic = wire::make_reply_topic<Operation>(participant);
    if (!reply_topic) return tl::make_unexpected(reply_topic.error());
    const auto request_topic = wire::make_request_topic<Operation>(participant);
    if (!request_topic) return tl::make_unexpected(request_topic.error());
    const auto heard = wire::dds::StatusMask::data_available() << wire::dds::StatusMask::subscription_matched();
    caller->reader_ =
        subscriber.create_datareader(*reply_topic, wire::call_reader_qos(wire::kReplyDepth), caller.get(), heard);
    caller->writer_ = publisher.create_datawriter(*request_topic, wire::call_writer_qos(wire::kReplyDepth),
                                                  caller.get(), wire::dds::StatusMask::publication_matched());
    if (caller->reader_ == nullptr || caller->writer_ == nullptr) {
      return failure(ErrorCode::kInternal, "cannot create the endpoints of {}", Operation::kName);
    }
    caller->guid_ = wire::octets_of(caller->writer_->guid());
    return caller;
  }

  ~Caller() override {
    if (writer_ != nullptr) publisher_.delete_datawriter(writer_);
    if (reader_ != nullptr) subscriber_.delete_datareader(reader_);
  }

  /// Sends the request to a server whose reader and writer are matched. If that server leaves, or is silent for half of
  /// the time, the request is sent once more with the same id. kUnreachable: no answer by `deadline`.
  [[nodiscard]] Result<Reply> call(Request request, const Route& route, Clock::time_point deadline) {
    request.header().contract_version(wire::CONTRACT_VERSION);
    request.header().reply_partition(partition_);
    auto& id = request.header().request_id();
    id.writer_guid(guid_);
    MutexLock lock(mutex_);
    if (!room_.wait_until(lock, deadline,
                          [this]() TRAMMEL_REQUIRES(mutex_) { return waiting_.size() < wire::kReplyDepth; })) {
      return failure(ErrorCode::kBusy, "{}: {} calls of this session are unanswered", Operation::kName,
                     wire::kReplyDepth);
    }
    id.sequence_number(++last_sequence_);
    request.header().trace_id(fmt::format("{}-{}", partition_.substr(partition_.size() - kTraceBytes), last_sequence_));
    waiting_.try_emplace(last_sequence_);
    lock.unlock();
    auto answer = attempt_twice(request, route, deadline);
    lock.lock();
    waiting_.erase(id.sequence_number());
    room_.notify_one();
    return answer;
  }

 private:
  static constexpr std::size_t kTraceBytes = 8;  // of the partition's name

  /// A call under way. An element of waiting_, guarded by the same mutex.
  struct Waiting {
    Condition changed;
    std::optional<Reply> reply;
  };

  Caller(wire::dds::Publisher& publisher, wire::dds::Subscriber& subscriber, std::string partition, ServerWatch& watch)
      : publisher_(publisher), subscriber_(subscriber), partition_(std::move(partition)), watch_(watch) {}

  Result<Reply> attempt_twice(Request& request, const Route& route, Clock::time_point deadline) {
    const auto now = Clock::now();
    std::string asked;
    for (const bool again : {false, true}) {
      const auto until = again ? deadline : now + (deadline - now) / 2;
      // The repeat may also go to a server whose reply writer is not matched yet: it may have had too many clients.
      const auto server = watch_.wait_for_server(
          route.cell, route.changes_something ? std::string() : asked, until, [&](const KnownServer& known) {
            return (route.server.empty() || route.server == known.id()) && reachable(known.participant, !again);
          });
      if (!server) continue;
      asked = server->id();
      request.header().server(asked);
      request.header().deadline_ms(milliseconds_until(deadline));
      if (!writer_->write(&request)) {
        return failure(ErrorCode::kTooLarge, "{}: the request is too large", Operation::kName);
      }
      MutexLock lock(mutex_);
      Waiting& waiting = waiting_.at(request.header().request_id().sequence_number());
      waiting.changed.wait_until(lock, until, [&]() TRAMMEL_REQUIRES(mutex_) {
        return waiting.reply || !readers_.contains(server->participant);
      });
      if (waiting.reply) return std::move(*waiting.reply);
    }
    if (const auto other = watch_.other_contract(); asked.empty() && other) return tl::make_unexpected(*other);
    return asked.empty()
               ? failure(ErrorCode::kUnreachable, "{}: no server found in time", Operation::kName)
               : failure(ErrorCode::kUnreachable, "{}: server {} did not answer in time", Operation::kName, asked);
  }

  /// At least one: zero would be no deadline.
  static std::uint32_t milliseconds_until(Clock::time_point deadline) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>(left, 1, std::numeric_limits<std::uint32_t>::max()));
  }

  [[nodiscard]] bool reachable(const std::string& participant, bool and_back) const {
    const MutexLock lock(mutex_);
    return readers_.contains(participant) && (!and_back || writers_.contains(participant));
  }

  void on_publication_matched(wire::dds::DataWriter*, const wire::dds::PublicationMatchedStatus& status) override {
    {
      const MutexLock lock(mutex_);
      matched(readers_, status.last_subscription_handle, status.current_count_change);
    }
    watch_.wake();
  }

  void on_subscription_matched(wire::dds::DataReader*, const wire::dds::SubscriptionMatchedStatus& status) override {
    {
      const MutexLock lock(mutex_);
      matched(writers_, status.last_publication_handle, status.current_count_change);
    }
    watch_.wake();
  }

  void matched(std::set<std::string>& peers, const wire::dds::InstanceHandle_t& peer, int change)
      TRAMMEL_REQUIRES(mutex_) {
    const std::string participant = wire::participant_of(eprosima::fastrtps::rtps::iHandle2GUID(peer));
    if (change > 0) {
      peers.insert(participant);
    } else {
      peers.erase(participant);
      for (auto& [sequence, waiting] : waiting_) waiting.changed.notify_all();
    }
  }

  void on_data_available(wire::dds::DataReader* reader) override {
    Reply reply;
    wire::dds::SampleInfo info;
    while (reader->take_next_sample(&reply, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const MutexLock lock(mutex_);
      const wire::SampleIdentity& id = reply.header().related_request_id();
      const auto found = waiting_.find(id.sequence_number());
      if (found == waiting_.end() || found->second.reply || id.writer_guid() != guid_) continue;
      found->second.reply = std::move(reply);
      found->second.changed.notify_all();
      reply = Reply();
    }
  }

  wire::dds::Publisher& publisher_;
  wire::dds::Subscriber& subscriber_;
  const std::string partition_;
  ServerWatch& watch_;
  wire::dds::DataWriter* writer_ = nullptr;
  wire::dds::DataReader* reader_ = nullptr;
  std::array<std::uint8_t, 16> guid_{};  // of writer_
  mutable Mutex mutex_;
  Condition room_;                                                      // waiting_ has shrunk
  std::set<std::string> readers_ TRAMMEL_GUARDED_BY(mutex_);            // participants that read our requests
  std::set<std::string> writers_ TRAMMEL_GUARDED_BY(mutex_);            // participants that write replies to us
  std::map<std::int64_t, Waiting> waiting_ TRAMMEL_GUARDED_BY(mutex_);  // by sequence number
  std::int64_t last_sequence_ TRAMMEL_GUARDED_BY(mutex_) = 0;
};

}  // namespace trammel::client
