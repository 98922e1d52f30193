#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
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

/// Where a call goes and how it is repeated.
struct Route {
  std::string cell;                ///< preferably to a server that has it
  std::string server;              ///< only to this one; empty: any
  bool changes_something = false;  ///< repeated rather at the same server, which recognises it, than elsewhere
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
    const auto& guid = caller->writer_->guid();
    const auto rest = std::copy_n(guid.guidPrefix.value, guid.guidPrefix.size, caller->guid_.begin());
    std::copy_n(guid.entityId.value, guid.entityId.size, rest);
    return caller;
  }

  ~Caller() override {
    if (writer_ != nullptr) publisher_.delete_datawriter(writer_);
    if (reader_ != nullptr) subscriber_.delete_datareader(reader_);
  }

  /// Sends the request to a server that is matched both ways and, when that one leaves or is silent for half of the
  /// time, once more with the same id. kUnreachable when nobody answers by `deadline`.
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
    waiting_.try_emplace(last_sequence_);
    lock.unlock();
    auto answer = attempt_twice(request, route, deadline);
    lock.lock();
    waiting_.erase(id.sequence_number());
    room_.notify_one();
    return answer;
  }

 private:
  /// A call under way; one of waiting_, and guarded with it.
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
      // The second time also to a server whose way back is not known yet: it may have had too many clients.
      const auto server = watch_.wait_for_server(
          route.cell, route.changes_something ? std::string() : asked, until, [&](const KnownServer& known) {
            return (route.server.empty() || route.server == known.id()) && reachable(known.participant, !again);
          });
      if (!server) continue;
      asked = server->id();
      request.header().server(asked);
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
    return asked.empty()
               ? failure(ErrorCode::kUnreachable, "{}: no server found in time", Operation::kName)
               : failure(ErrorCode::kUnreachable, "{}: server {} did not answer in time", Operation::kName, asked);
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
  Condition room_;                                                      // waiting_ has become smaller
  std::set<std::string> readers_ TRAMMEL_GUARDED_BY(mutex_);            // participants that read our requests
  std::set<std::string> writers_ TRAMMEL_GUARDED_BY(mutex_);            // participants that write replies to us
  std::map<std::int64_t, Waiting> waiting_ TRAMMEL_GUARDED_BY(mutex_);  // by sequence number
  std::int64_t last_sequence_ TRAMMEL_GUARDED_BY(mutex_) = 0;
};

}  // namespace trammel::client
