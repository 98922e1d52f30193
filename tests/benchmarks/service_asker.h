#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "idl/transport/transport.h"

/// Clients without a session, and a server that computes nothing: what is left is the transport.
namespace trammel::test {

using Millis = std::chrono::duration<double, std::milli>;

/// Asks a server for one operation. One thread asks and waits, or one asks and the listener notes
/// what comes.
template <typename Operation>
class Asker final : private wire::dds::DataWriterListener, private wire::dds::DataReaderListener {
 public:
  using Request = typename Operation::Request::type;
  using Reply = typename Operation::Reply::type;
  using Clock = std::chrono::steady_clock;

  Asker(std::uint32_t domain, std::uint16_t port, std::string partition)
      : partition_(std::move(partition)) {
    participant_ = wire::make_participant({"asker", domain, "127.0.0.1", 0, {port}}).value();
    auto* requests = wire::make_request_topic<Operation>(*participant_).value();
    auto* replies = wire::make_reply_topic<Operation>(*participant_).value();
    const auto heard = wire::dds::StatusMask::data_available()
                       << wire::dds::StatusMask::subscription_matched();
    participant_->create_subscriber(wire::subscriber_qos(partition_))
        ->create_datareader(replies, wire::call_reader_qos(wire::kReplyDepth), this, heard);
    writer_ = participant_->create_publisher(wire::publisher_qos({}))
                  ->create_datawriter(requests, wire::call_writer_qos(wire::kReplyDepth), this,
                                      wire::dds::StatusMask::publication_matched());
  }
  ~Asker() override { participant_.reset(); }
  Asker(const Asker&) = delete;
  Asker& operator=(const Asker&) = delete;

  [[nodiscard]] bool wait_until_matched() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(20),
                             [this] { return reads_ > 0 && writes_ > 0; });
  }

  /// Sends the request under the next number.
  void send(Request& request) {
    auto& header = request.header();
    header.reply_partition(partition_);
    header.contract_version(wire::CONTRACT_VERSION);
    header.request_id().writer_guid(wire::octets_of(writer_->guid()));
    {
      const std::lock_guard lock(mutex_);
      header.request_id().sequence_number(++sent_);
      asked_[sent_] = Clock::now();
    }
    writer_->write(&request);
  }
  /// Sends the request and waits for its reply: how long that took. Empty: no good reply in time.
  [[nodiscard]] std::optional<Millis> ask(Request& request,
                                          std::chrono::seconds limit = std::chrono::seconds(60)) {
    send(request);
    const std::int64_t number = request.header().request_id().sequence_number();
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, limit, [&] { return times_.contains(number); }))
      return std::nullopt;
    return times_.at(number);
  }
  /// Until as many have been answered as were sent, or `limit` is over.
  void wait_for_all(std::chrono::seconds limit) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, limit,
                      [&] { return times_.size() + busy_ >= static_cast<std::size_t>(sent_); });
  }

  struct Tally {
    std::int64_t sent = 0, answered = 0, busy = 0, twice = 0;
    std::vector<double> times_ms;
  };
  [[nodiscard]] Tally tally() {
    const std::lock_guard lock(mutex_);
    Tally all{sent_,
              static_cast<std::int64_t>(times_.size()),
              static_cast<std::int64_t>(busy_),
              twice_,
              {}};
    for (const auto& [number, time] : times_) all.times_ms.push_back(time.count());
    return all;
  }

 private:
  void on_publication_matched(wire::dds::DataWriter*,
                              const wire::dds::PublicationMatchedStatus& status) override {
    note([&] { reads_ = status.current_count; });
  }
  void on_subscription_matched(wire::dds::DataReader*,
                               const wire::dds::SubscriptionMatchedStatus& status) override {
    note([&] { writes_ = status.current_count; });
  }
  void on_data_available(wire::dds::DataReader* reader) override {
    wire::dds::SampleInfo info;
    while (reader->take_next_sample(&reply_, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      const auto now = Clock::now();
      if (info.valid_data) note([&] { take(now); });
    }
  }
  void take(Clock::time_point now) {
    const std::int64_t number = reply_.header().related_request_id().sequence_number();
    const auto asked = asked_.find(number);
    if (asked == asked_.end()) {
      ++twice_;
      return;
    }
    if (reply_.header().result() == wire::RESULT_OK) {
      times_[number] = now - asked->second;
    } else {
      ++busy_;
    }
    asked_.erase(asked);
  }
  template <typename Change>
  void note(const Change& change) {
    {
      const std::lock_guard lock(mutex_);
      change();
    }
    changed_.notify_all();
  }

  const std::string partition_;
  wire::ParticipantPtr participant_;
  wire::dds::DataWriter* writer_ = nullptr;
  Reply reply_;  // of the listener
  std::mutex mutex_;
  std::condition_variable changed_;
  int reads_ = 0, writes_ = 0;  // guarded by mutex_, as all that follows
  std::int64_t sent_ = 0, twice_ = 0;
  std::size_t busy_ = 0;
  std::map<std::int64_t, Clock::time_point> asked_;  // not answered yet
  std::map<std::int64_t, Millis> times_;             // of good replies
};

/// A server on raw Fast DDS: a listener that wakes workers, workers that take a request and reply
/// with as many items.
template <typename Operation>
class Echo final : private wire::dds::DataReaderListener {
 public:
  using Request = typename Operation::Request::type;
  using Reply = typename Operation::Reply::type;
  /// Fills in as many items as were asked for.
  using Fill = void (*)(const Request&, Reply&);

  Echo(wire::dds::DomainParticipant& participant, Fill fill, int workers)
      : participant_(participant), fill_(fill) {
    reply_topic_ = wire::make_reply_topic<Operation>(participant).value();
    reader_ = participant.create_subscriber(wire::subscriber_qos({}))
                  ->create_datareader(wire::make_request_topic<Operation>(participant).value(),
                                      wire::call_reader_qos(wire::kRequestDepth), this,
                                      wire::dds::StatusMask::data_available());
    for (int i = 0; i < workers; ++i)
      workers_.emplace_back([this](const std::stop_token& stop) { work(stop); });
  }
  ~Echo() override { workers_.clear(); }

  /// Makes the reply writer of a client: as the server does where a reply reader is found.
  void expect(const std::string& partition) {
    auto* writer = participant_.create_publisher(wire::publisher_qos(partition))
                       ->create_datawriter(reply_topic_, wire::call_writer_qos(wire::kReplyDepth));
    const std::lock_guard lock(mutex_);
    writers_.try_emplace(partition, writer);
  }
  [[nodiscard]] bool expects(const std::string& partition) {
    const std::lock_guard lock(mutex_);
    return writers_.contains(partition);
  }
  [[nodiscard]] const std::string& reply_topic() const { return reply_topic_->get_name(); }

 private:
  void on_data_available(wire::dds::DataReader*) override {
    {
      const std::lock_guard lock(mutex_);
      ++arrivals_;
    }
    arrived_.notify_one();
  }
  void work(const std::stop_token& stop) {
    Request request;
    wire::dds::SampleInfo info;
    while (!stop.stop_requested()) {
      std::unique_lock lock(mutex_);
      const std::uint64_t seen = arrivals_;
      lock.unlock();
      while (reader_->take_next_sample(&request, &info) ==
             eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
        if (info.valid_data) answer(request);
      }
      lock.lock();
      arrived_.wait(lock, stop, [&] { return arrivals_ != seen; });
    }
  }
  void answer(const Request& request) {
    Reply reply;
    fill_(request, reply);
    reply.header().related_request_id(request.header().request_id());
    wire::dds::DataWriter* writer = nullptr;
    {
      const std::lock_guard lock(mutex_);
      const auto found = writers_.find(request.header().reply_partition().to_string());
      if (found == writers_.end()) return;
      writer = found->second;
    }
    writer->write(&reply);
  }

  wire::dds::DomainParticipant& participant_;
  const Fill fill_;
  wire::dds::Topic* reply_topic_ = nullptr;
  wire::dds::DataReader* reader_ = nullptr;
  std::mutex mutex_;
  std::condition_variable_any arrived_;
  std::uint64_t arrivals_ = 0;                             // guarded by mutex_
  std::map<std::string, wire::dds::DataWriter*> writers_;  // guarded by mutex_; by partition
  std::vector<std::jthread> workers_;
};

}  // namespace trammel::test
