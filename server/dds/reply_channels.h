#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/transport.h"
#include "server/base/mutex.h"
#include "server/dds/reply_sink.h"
#include "server/dds/schedule/channel_book.h"
#include "server/dds/schedule/outbox.h"
#include "server/dds/service_events.h"
#include "server/dds/stillness.h"

namespace trammel {

/// A writer of one reply topic to one client.
class ReplyWriter final : private wire::dds::DataWriterListener {
 public:
  /// Null when DDS refuses. `matched` is called when a reader has been matched, in a thread of DDS.
  [[nodiscard]] static std::shared_ptr<ReplyWriter> make(wire::dds::Publisher& publisher, wire::dds::Topic* topic,
                                                         std::function<void()> matched);
  ~ReplyWriter() override;
  ReplyWriter(const ReplyWriter&) = delete;
  ReplyWriter& operator=(const ReplyWriter&) = delete;

  [[nodiscard]] bool has_reader() const { return readers_ > 0; }
  /// Does not wait for the reader: what it does not take in time is overwritten.
  [[nodiscard]] bool write(void* reply) { return writer_->write(reply); }

 private:
  ReplyWriter(wire::dds::Publisher& publisher, std::function<void()> matched);
  void on_publication_matched(wire::dds::DataWriter* writer,
                              const wire::dds::PublicationMatchedStatus& status) override;

  wire::dds::Publisher& publisher_;
  const std::function<void()> matched_;
  wire::dds::DataWriter* writer_ = nullptr;
  std::atomic<int> readers_{0};
};

/// The reply channels: a publisher in the partition of each client, and a writer for each topic that it listens to.
/// They are made when discovery finds the client's readers, and only then; ChannelBook says who has one. A reply to a
/// reader that is not matched yet waits in an outbox, for a bounded time. Thread-safe.
class ReplyChannels final : public ReplySink {
 public:
  /// `wants_tending`: called when tend() has something to do. `writing` watches over what is written.
  ReplyChannels(wire::dds::DomainParticipant& participant, std::size_t capacity, std::function<void()> wants_tending,
                WorkUnderWay& writing);

  /// Adds a topic of replies. Call it before any other function.
  void add_topic(wire::dds::Topic* topic);
  /// What discovery has found since.
  void heard(const std::vector<ReaderEvent>& events);
  /// Opens and closes channels. Call it from one thread only. True while clients wait for a channel.
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
  [[nodiscard]] std::shared_ptr<Expectation> expect(const std::string& participant, const std::string& partition);

  /// Writes the reply, or keeps it until the client's reader is matched.
  void send(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override;
  void post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override;
  /// Writes what was posted, and what was kept once its reader is matched, until `stop`.
  void deliver(const std::stop_token& stop);

  /// Replies that were dropped because nobody listened.
  [[nodiscard]] std::uint64_t unheard() const { return unheard_; }
  [[nodiscard]] std::size_t clients() const;

 private:
  class Channel;
  using Writer = std::shared_ptr<ReplyWriter>;
  void answered(const std::string& partition);
  void matched();
  void change(const ChannelBook::Change& change);
  void open(const std::string& partition, const std::string& topic);
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
  std::atomic<std::uint64_t> unheard_{0};
  mutable Mutex mutex_;
  Condition due_;
  std::map<std::string, wire::dds::Topic*> topics_ TRAMMEL_GUARDED_BY(mutex_);           // by name
  std::map<std::string, std::shared_ptr<Channel>> channels_ TRAMMEL_GUARDED_BY(mutex_);  // by partition
  std::vector<std::shared_ptr<Channel>> closed_ TRAMMEL_GUARDED_BY(mutex_);  // perhaps still in use by a sender
  ChannelBook book_ TRAMMEL_GUARDED_BY(mutex_);
  Outbox posted_ TRAMMEL_GUARDED_BY(mutex_);
  Outbox kept_ TRAMMEL_GUARDED_BY(mutex_);  // until their reader is matched
  bool has_matched_ TRAMMEL_GUARDED_BY(mutex_) = false;
};

}  // namespace trammel
