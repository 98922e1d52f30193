#pragma once

#include <algorithm>
#include <array>
#include <chrono>
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
#include "idl/transport/transport.h"
#include "server/base/mutex.h"

namespace trammel::client {

/// The server of a call, and the way in which the call is repeated.
struct Route {
  std::string cell;  ///< preferred: a server that serves this cell
  std::string
      server;  ///< only this server, or another one of its record as `record` says; empty: any
  bool changes_something =
      false;  ///< a repeat goes to the same server or, if that one has left, to its record
  bool may_be_long = false;  ///< the answer comes from the record, so a moment of silence does not
                             ///< mean that the server is gone
  std::string record =
      {};  ///< of `server`, if any server of the same record can answer for it; else empty
};

/// One operation of a session: a request writer, a reply reader in the session's partition, and the
/// calls that wait. Thread-safe; calls overlap.
template <typename Operation>
class Caller final : private wire::dds::DataWriterListener, private wire::dds::DataReaderListener {
 public:
  using Request = typename Operation::Request::type;
  using Reply = typename Operation::Reply::type;

  [[nodiscard]] static Result<std::unique_ptr<Caller>> open(
      wire::dds::DomainParticipant& participant, wire::dds::Publisher& publisher,
      wire::dds::Subscriber& subscriber, const std::string& partition, ServerWatch& watch) {
    std::unique_ptr<Caller> caller(new Caller(publisher, subscriber, partition, watch));
    const auto reply_topic = wire::make_reply_topic<Operation>(participant);
    if (!reply_topic) return tl::make_unexpected(reply_topic.error());
    const auto request_topic = wire::make_request_topic<Operation>(participant);
    if (!request_topic) return tl::make_unexpected(request_topic.error());
    const auto heard = wire::dds::StatusMask::data_available()
                       << wire::dds::StatusMask::subscription_matched();
    caller->reader_ = subscriber.create_datareader(
        *reply_topic, wire::call_reader_qos(wire::kReplyDepth), caller.get(), heard);
    caller->writer_ =
        publisher.create_datawriter(*request_topic, wire::call_writer_qos(wire::kReplyDepth),
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

  /// Sends the request to a server whose reader and writer are matched, and repeats it as Sending
  /// says, always with the same id: the first answer counts. kUnreachable: no answer by `deadline`.
  [[nodiscard]] Result<Reply> call(Request request, const Route& route,
                                   Clock::time_point deadline) {
    request.header().contract_version(wire::CONTRACT_VERSION);
    request.header().reply_partition(partition_);
    auto& id = request.header().request_id();
    id.writer_guid(guid_);
    MutexLock lock(mutex_);
    if (!room_.wait_until(lock, deadline, [this]() TRAMMEL_REQUIRES(mutex_) {
          return waiting_.size() < wire::kReplyDepth;
        })) {
      return failure(ErrorCode::kBusy, "{}: {} calls of this session are unanswered",
                     Operation::kName, wire::kReplyDepth);
    }
    id.sequence_number(++last_sequence_);
    request.header().trace_id(
        fmt::format("{}-{}", partition_.substr(partition_.size() - kTraceBytes), last_sequence_));
    waiting_.try_emplace(last_sequence_);
    lock.unlock();
    auto answer = attempt(request, route, deadline);
    lock.lock();
    waiting_.erase(id.sequence_number());
    room_.notify_one();
    return answer;
  }

 private:
  static constexpr std::size_t kTraceBytes = 8;  // of the partition's name
  static constexpr std::chrono::milliseconds kHedge{100};

  /// A call under way. An element of waiting_, guarded by the same mutex.
  struct Waiting {
    Condition changed;
    std::optional<Reply> reply;
  };

  Caller(wire::dds::Publisher& publisher, wire::dds::Subscriber& subscriber, std::string partition,
         ServerWatch& watch)
      : publisher_(publisher),
        subscriber_(subscriber),
        partition_(std::move(partition)),
        watch_(watch) {}

  /// The times at which a request is sent. A request that all servers answer alike goes to a second
  /// one if the first is silent for kHedge, or leaves. At half of the time it is sent once more. A
  /// change then goes to the same server or, if that one has left, to another one of its record,
  /// since these make a change once under its id. It is sent once more if the server leaves only
  /// later.
  enum class Sending { kFirst, kHedge, kAgain, kOfOthers };
  struct Asked {
    std::set<std::string> participants;
    std::string first, last;  ///< servers
    std::string record;       ///< the record of the last server; empty: a record of its own
  };

  Result<Reply> attempt(Request& request, const Route& route, Clock::time_point deadline) {
    const auto half = Clock::now() + (deadline - Clock::now()) / 2;
    const bool hedges = !route.changes_something && !route.may_be_long && route.server.empty();
    Asked asked;
    for (const Sending sending :
         {Sending::kFirst, Sending::kHedge, Sending::kAgain, Sending::kOfOthers}) {
      if (sending == Sending::kHedge && (!hedges || asked.first.empty())) continue;
      if (sending == Sending::kOfOthers && !has_left(asked.participants)) break;
      const bool is_late = sending == Sending::kAgain || sending == Sending::kOfOthers;
      if (const auto server = find_server(sending, route, asked, is_late ? deadline : half)) {
        asked.last = server->id();
        if (asked.first.empty()) asked.first = asked.last;
        asked.record = server->status.record().to_string();
        asked.participants.insert(server->participant);
        request.header().server(asked.last);
        request.header().deadline_ms(milliseconds_until(deadline));
        if (!writer_->write(&request)) {
          return failure(ErrorCode::kTooLarge, "{}: the request is too large", Operation::kName);
        }
      }
      auto until = is_late ? deadline : half;
      if (sending == Sending::kFirst && hedges) until = std::min(until, Clock::now() + kHedge);
      if (auto reply = wait_for_reply(request.header().request_id().sequence_number(),
                                      asked.participants, until)) {
        if (reply->header().server().to_string() != asked.first) watch_.was_slow(asked.first);
        return *std::move(reply);
      }
    }
    return unanswered(asked.last);
  }

  /// True if none of them is there any more.
  [[nodiscard]] bool has_left(const std::set<std::string>& asked) const {
    const MutexLock lock(mutex_);
    return std::none_of(asked.begin(), asked.end(),
                        [&](const std::string& participant)
                            TRAMMEL_REQUIRES(mutex_) { return readers_.contains(participant); });
  }

  [[nodiscard]] std::optional<KnownServer> find_server(Sending sending, const Route& route,
                                                       const Asked& asked,
                                                       Clock::time_point until) {
    if (sending == Sending::kHedge)
      return watch_.another_server(route.cell, asked.last, [&](const auto& known) {
        return reachable(known.participant, true);
      });
    // The repeat may also go to a server whose reply writer is not matched yet, since that server
    // may have had too many clients.
    const bool and_back = sending == Sending::kFirst;
    const std::string avoided =
        route.changes_something || has_left(asked.participants) ? std::string() : asked.last;
    return watch_.wait_for_server(route.cell, avoided, until, [&](const KnownServer& known) {
      return may_answer(known, route, asked) && reachable(known.participant, and_back);
    });
  }

  [[nodiscard]] bool may_answer(const KnownServer& known, const Route& route,
                                const Asked& asked) const {
    const auto shares = [&](const std::string& record) {
      return !record.empty() && known.status.record().to_string() == record;
    };
    if (!route.server.empty() && route.server != known.id() && !shares(route.record)) return false;
    if (!route.changes_something || asked.last.empty() || asked.last == known.id()) return true;
    return shares(asked.record) && serves(known, route.cell) && has_left(asked.participants);
  }

  /// Waits until the reply is there, or until all servers that got the request have left.
  [[nodiscard]] std::optional<Reply> wait_for_reply(std::int64_t sequence,
                                                    const std::set<std::string>& asked,
                                                    Clock::time_point until) {
    MutexLock lock(mutex_);
    Waiting& waiting = waiting_.at(sequence);
    waiting.changed.wait_until(lock, until, [&]() TRAMMEL_REQUIRES(mutex_) {
      return waiting.reply ||
             std::none_of(asked.begin(), asked.end(),
                          [&](const std::string& participant)
                              TRAMMEL_REQUIRES(mutex_) { return readers_.contains(participant); });
    });
    return std::exchange(waiting.reply, std::nullopt);
  }

  [[nodiscard]] Result<Reply> unanswered(const std::string& asked) const {
    if (const auto other = watch_.other_contract(); asked.empty() && other)
      return tl::make_unexpected(*other);
    return asked.empty()
               ? failure(ErrorCode::kUnreachable, "{}: no server found in time", Operation::kName)
               : failure(ErrorCode::kUnreachable, "{}: server {} did not answer in time",
                         Operation::kName, asked);
  }

  /// At least one: zero would be no deadline.
  static std::uint32_t milliseconds_until(Clock::time_point deadline) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    return static_cast<std::uint32_t>(
        std::clamp<std::int64_t>(left, 1, std::numeric_limits<std::uint32_t>::max()));
  }

  [[nodiscard]] bool reachable(const std::string& participant, bool and_back) const {
    const MutexLock lock(mutex_);
    return readers_.contains(participant) && (!and_back || writers_.contains(participant));
  }

  void on_publication_matched(wire::dds::DataWriter*,
                              const wire::dds::PublicationMatchedStatus& status) override {
    {
      const MutexLock lock(mutex_);
      matched(readers_, status.last_subscription_handle, status.current_count_change);
    }
    watch_.wake();
  }

  void on_subscription_matched(wire::dds::DataReader*,
                               const wire::dds::SubscriptionMatchedStatus& status) override {
    {
      const MutexLock lock(mutex_);
      matched(writers_, status.last_publication_handle, status.current_count_change);
    }
    watch_.wake();
  }

  void matched(std::set<std::string>& peers, const wire::dds::InstanceHandle_t& peer, int change)
      TRAMMEL_REQUIRES(mutex_) {
    const std::string participant =
        wire::participant_of(eprosima::fastrtps::rtps::iHandle2GUID(peer));
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
    while (reader->take_next_sample(&reply, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
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
  Condition room_;                                            // waiting_ has shrunk
  std::set<std::string> readers_ TRAMMEL_GUARDED_BY(mutex_);  // participants that read our requests
  std::set<std::string> writers_
      TRAMMEL_GUARDED_BY(mutex_);  // participants that write replies to us
  std::map<std::int64_t, Waiting> waiting_ TRAMMEL_GUARDED_BY(mutex_);  // by sequence number
  std::int64_t last_sequence_ TRAMMEL_GUARDED_BY(mutex_) = 0;
};

}  // namespace trammel::client
