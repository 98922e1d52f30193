#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "idl/transport/transport.h"

namespace trammel {

/// Makes an error reply in place of one that cannot be written.
using InsteadOf = std::function<std::shared_ptr<void>(const void* reply)>;

/// A writer of one reply topic to one client.
class ReplyWriter final : private wire::dds::DataWriterListener {
 public:
  /// Null when DDS refuses. `matched` is called when a reader has been matched, in a thread of DDS.
  [[nodiscard]] static std::shared_ptr<ReplyWriter> make(wire::dds::Publisher& publisher,
                                                         wire::dds::Topic* topic,
                                                         std::function<void()> matched,
                                                         InsteadOf instead = nullptr);
  ~ReplyWriter() override;
  ReplyWriter(const ReplyWriter&) = delete;
  ReplyWriter& operator=(const ReplyWriter&) = delete;

  [[nodiscard]] bool has_reader() const { return readers_ > 0; }
  /// Does not wait for the reader: samples that it does not take in time are overwritten. A reply
  /// that does not fit on the wire is replaced by an error. False: nothing was written.
  [[nodiscard]] bool write(void* reply);

 private:
  ReplyWriter(wire::dds::Publisher& publisher, std::function<void()> matched, InsteadOf instead);
  void on_publication_matched(wire::dds::DataWriter* writer,
                              const wire::dds::PublicationMatchedStatus& status) override;

  wire::dds::Publisher& publisher_;
  const std::function<void()> matched_;
  const InsteadOf instead_;
  wire::dds::DataWriter* writer_ = nullptr;
  std::atomic<int> readers_{0};
};

/// A publisher in the partition of a client, and its writers. Not thread-safe.
class ReplyChannel {
 public:
  using Writer = std::shared_ptr<ReplyWriter>;

  ReplyChannel(wire::dds::DomainParticipant& participant, const std::string& partition);
  ~ReplyChannel();
  ReplyChannel(const ReplyChannel&) = delete;
  ReplyChannel& operator=(const ReplyChannel&) = delete;

  /// Null when DDS refuses.
  [[nodiscard]] wire::dds::Publisher* publisher() const { return publisher_; }
  void add(const std::string& topic, Writer writer) { writers_[topic] = std::move(writer); }
  [[nodiscard]] Writer writer(const std::string& topic) const;
  /// A sender has a writer in its hands.
  [[nodiscard]] bool is_in_use() const;
  [[nodiscard]] bool has_readers() const;
  /// With all its writers. False when DDS refuses.
  [[nodiscard]] bool move_to(const std::string& partition);
  [[nodiscard]] const std::string& partition() const { return partition_; }

 private:
  wire::dds::DomainParticipant& participant_;
  std::string partition_;
  wire::dds::Publisher* const publisher_;
  std::map<std::string, Writer> writers_;  // by topic
};

/// The channels of clients that have left, kept for others. Deleting a writer notifies all clients,
/// and the library removes that notice from its history when the last of them has confirmed it. If
/// the last one is dead, this happens when its lease ends. It may then coincide with the thread
/// that sends old notices to a newcomer: each holds the lock that the other needs, a deadlock. So
/// while clients come and go, a channel moves to the next client, and the rest is deleted when
/// nobody has left for a while. Libraries other than Fast DDS do not follow a writer to another
/// partition, so their clients get new channels. A client that returns under its name gets its own
/// channel: its readers match those writers as soon as it discovers them, and would miss samples of
/// other writers meanwhile. Not thread-safe.
class ParkedChannels {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Channel = std::shared_ptr<ReplyChannel>;

  void park(Channel channel, Time now);
  /// A channel for the client with this participant id; null: the caller makes one.
  [[nodiscard]] Channel take(const std::string& participant, const std::string& partition);
  /// Deletes unneeded channels, a few at a time. True if there are more to delete.
  bool tend(Time now);
  [[nodiscard]] std::size_t size() const { return parked_.size(); }

 private:
  std::vector<Channel> parked_;
  Time last_parked_{};
};

}  // namespace trammel
