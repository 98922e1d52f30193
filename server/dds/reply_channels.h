#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/transport/transport.h"
#include "server/base/mutex.h"
#include "server/dds/reply_channel.h"
#include "server/dds/reply_sink.h"
#include "server/dds/schedule/channel_book.h"
#include "server/dds/schedule/outbox.h"
#include "server/dds/service_events.h"
#include "server/dds/stillness.h"

namespace trammel {

/// The reply channels: a publisher in the partition of each client, and a writer for each topic to
/// which it listens. They are made when discovery finds the client's readers; ChannelBook decides
/// which clients have one. A reply to a reader that is not matched yet waits in an outbox, for a
/// limited time. Thread-safe.
class ReplyChannels final : public ReplySink {
 public:
  /// `wants_tending`: called when tend() has work. `writing` supervises the written samples.
  ReplyChannels(wire::dds::DomainParticipant& participant, std::size_t capacity,
                std::function<void()> wants_tending, WorkUnderWay& writing);

  /// Adds a topic of replies, and the error `instead` of a reply that cannot be written. Call it
  /// before any other function.
  void add_topic(wire::dds::Topic* topic, InsteadOf instead);
  /// Processes the new events of discovery.
  void heard(const std::vector<ReaderEvent>& events);
  /// Opens and closes channels. Call it from one thread only. True while clients wait for a
  /// channel.
  bool tend();

  /// A request that is not answered yet: its client keeps its channel.
  class Expectation {
   public:
    Expectation(ReplyChannels& channels, std::string partition)
        : channels_(channels), partition_(std::move(partition)) {}
    ~Expectation() { channels_.answered(partition_); }
    Expectation(const Expectation&) = delete;
    Expectation& operator=(const Expectation&) = delete;

   private:
    ReplyChannels& channels_;
    const std::string partition_;
  };
  /// Null when another participant listens in the partition: it would get the reply.
  [[nodiscard]] std::shared_ptr<Expectation> expect(const std::string& participant,
                                                    const std::string& partition);

  /// Writes the reply, or keeps it until the client's reader is matched.
  void send(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override;
  void post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override;
  /// Writes posted replies, and kept ones once their reader is matched, until `stop`.
  void deliver(const std::stop_token& stop);

  /// The number of rounds of deliver(), at least two per second. For the watchdog: takes no lock.
  [[nodiscard]] std::uint64_t looks() const { return looks_; }
  /// Replies that were dropped because nobody listened.
  [[nodiscard]] std::uint64_t unheard() const { return unheard_; }
  [[nodiscard]] std::size_t clients() const;

 private:
  using Writer = std::shared_ptr<ReplyWriter>;
  void answered(const std::string& partition);
  void matched();
  void change(const ChannelBook::Change& change);
  void open(const ChannelBook::Change& change);
  void close(const std::string& partition);
  /// Null: nobody of the participant is matched there.
  [[nodiscard]] Writer writer(const std::string& participant, const std::string& partition,
                              const std::string& topic) const TRAMMEL_REQUIRES(mutex_);
  void put(Outbox& outbox, const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes)
      TRAMMEL_REQUIRES(mutex_);
  void write(const Writer& writer, void* reply);
  struct Ready {
    Writer writer;
    std::shared_ptr<void> reply;
  };
  [[nodiscard]] std::vector<Ready> wait_for_ready(const std::stop_token& stop);
  void add_ready(std::list<Parcel> parcels, std::vector<Ready>* ready) TRAMMEL_REQUIRES(mutex_);

  wire::dds::DomainParticipant& participant_;
  const std::function<void()> wants_tending_;
  WorkUnderWay& writing_;
  ParkedChannels parked_;  // of the tending thread
  std::atomic<std::uint64_t> unheard_{0};
  std::atomic<std::uint64_t> looks_{0};
  mutable Mutex mutex_;
  Condition due_;
  struct ReplyTopic {
    wire::dds::Topic* topic = nullptr;
    InsteadOf instead;
  };
  std::map<std::string, ReplyTopic> topics_ TRAMMEL_GUARDED_BY(mutex_);  // by name
  std::map<std::string, std::shared_ptr<ReplyChannel>> channels_
      TRAMMEL_GUARDED_BY(mutex_);  // by partition
  std::vector<std::shared_ptr<ReplyChannel>> closed_
      TRAMMEL_GUARDED_BY(mutex_);  // perhaps still in use by a sender
  ChannelBook book_ TRAMMEL_GUARDED_BY(mutex_);
  Outbox posted_ TRAMMEL_GUARDED_BY(mutex_);
  Outbox kept_ TRAMMEL_GUARDED_BY(mutex_);  // until their reader is matched
  bool has_matched_ TRAMMEL_GUARDED_BY(mutex_) = false;
};

}  // namespace trammel
