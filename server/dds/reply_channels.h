#pragma once

#include <chrono>
#include <cstddef>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <map>
#include <memory>
#include <stop_token>
#include <string>

#include "idl/transport.h"
#include "server/base/mutex.h"

namespace trammel {

/// A writer of one reply topic to one client.
class ReplyWriter final : private wire::dds::DataWriterListener {
 public:
  /// Null when DDS refuses.
  [[nodiscard]] static std::unique_ptr<ReplyWriter> make(wire::dds::Publisher& publisher, wire::dds::Topic* topic);
  ~ReplyWriter() override;
  ReplyWriter(const ReplyWriter&) = delete;
  ReplyWriter& operator=(const ReplyWriter&) = delete;

  /// Waits a bounded time until the client's reader is matched: a reply written before would be lost.
  [[nodiscard]] bool send(void* reply, const std::stop_token& stop);
  /// No reader, and not waiting for the first one any more.
  [[nodiscard]] bool abandoned() const;

 private:
  explicit ReplyWriter(wire::dds::Publisher& publisher);
  void on_publication_matched(wire::dds::DataWriter* writer,
                              const wire::dds::PublicationMatchedStatus& status) override;

  wire::dds::Publisher& publisher_;
  wire::dds::DataWriter* writer_ = nullptr;
  mutable Mutex mutex_;
  Condition matched_;
  int readers_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::chrono::steady_clock::time_point patient_until_
      TRAMMEL_GUARDED_BY(mutex_);  // when there is no reader, wait until then
};

/// The way back to each client: a publisher in its partition and a writer for each operation it uses. Made on demand,
/// in worker threads only; dropped when the client has left, or when more clients than `capacity` are there.
/// Thread-safe.
class ReplyChannels {
 public:
  ReplyChannels(wire::dds::DomainParticipant& participant, std::size_t capacity)
      : participant_(participant), capacity_(capacity) {}

  /// A topic that replies go to; before anything else.
  void add_topic(wire::dds::Topic* topic);
  /// A client listens on the topic. Does nothing for an unknown topic, or when there are `capacity` clients already.
  void expect(const std::string& partition, const std::string& topic);
  /// `reply` is a sample of the topic's type. False when the client did not listen.
  [[nodiscard]] bool send(const std::string& partition, wire::dds::Topic* topic, void* reply,
                          const std::stop_token& stop);
  /// Forgets some of the clients that have left; whether there may be more of them.
  bool sweep();
  [[nodiscard]] std::size_t clients() const;

 private:
  class Client;
  struct Known {
    std::shared_ptr<Client> client;
    std::chrono::steady_clock::time_point last_used;
  };
  [[nodiscard]] std::shared_ptr<Client> client(const std::string& partition, bool crowd_out);

  wire::dds::DomainParticipant& participant_;
  const std::size_t capacity_;
  mutable Mutex mutex_;
  std::map<std::string, wire::dds::Topic*> topics_ TRAMMEL_GUARDED_BY(mutex_);  // by name
  std::map<std::string, Known> clients_ TRAMMEL_GUARDED_BY(mutex_);             // by partition
};

}  // namespace trammel
