#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "idl/transport/transport.h"

namespace trammel::test {

/// Serialized samples as they travel: encapsulation and content.
using Bytes = std::vector<unsigned char>;

template <typename PubSubType>
Bytes to_bytes(typename PubSubType::type sample) {
  PubSubType type;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&sample)());
  if (!type.serialize(&sample, &payload)) throw std::runtime_error("cannot serialize");
  return {payload.data, payload.data + payload.length};
}

/// A type by name only: its samples are whatever bytes somebody hands over.
class AnyBytesType final : public wire::dds::TopicDataType {
 public:
  explicit AnyBytesType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 1024;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    const Bytes& bytes = *static_cast<Bytes*>(data);
    payload->length = static_cast<std::uint32_t>(bytes.size());
    std::copy(bytes.begin(), bytes.end(), payload->data);
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t*, void*) override { return false; }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Bytes*>(data)->size()); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

/// A client that sends anything, and counts every reply that comes to its partition.
template <typename Operation>
class RawClient final : private wire::dds::DataWriterListener,
                        private wire::dds::DataReaderListener {
 public:
  using Request = typename Operation::Request::type;
  using Reply = typename Operation::Reply::type;

  /// `security`: the folder of its certificate; empty: none.
  RawClient(std::uint32_t domain, std::uint16_t port, std::string partition,
            const std::string& security = "")
      : partition_(std::move(partition)) {
    wire::ParticipantOptions options{"raw client", domain, "127.0.0.1", 0, {port}};
    if (!security.empty()) options.security = wire::read_security(security).value();
    participant_ = wire::make_participant(options).value();
    wire::dds::TypeSupport type(new AnyBytesType(typename Operation::Request().getName()));
    type.register_type(participant_.get());
    auto* requests = participant_->create_topic(wire::topic_name(Operation::kName, "_Request"),
                                                type.get_type_name(), wire::dds::TOPIC_QOS_DEFAULT);
    auto* replies = wire::make_reply_topic<Operation>(*participant_).value();
    participant_->create_subscriber(wire::subscriber_qos(partition_))
        ->create_datareader(replies, wire::call_reader_qos(1000), this,
                            wire::dds::StatusMask::data_available()
                                << wire::dds::StatusMask::subscription_matched());
    writer_ = participant_->create_publisher(wire::publisher_qos({}))
                  ->create_datawriter(requests, wire::call_writer_qos(1000), this,
                                      wire::dds::StatusMask::publication_matched());
  }
  ~RawClient() override { participant_.reset(); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  [[nodiscard]] bool wait_for_server() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kLimit, [this] { return matched_ > 0; });
  }
  /// Until the server listens to the requests and its replies are matched too, as idl/README.md
  /// asks.
  [[nodiscard]] bool wait_until_matched() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kLimit, [this] { return matched_ > 0 && answers_ > 0; });
  }
  [[nodiscard]] bool is_matched() {
    const std::lock_guard lock(mutex_);
    return matched_ > 0 && answers_ > 0;
  }
  /// Its GUID; the first twelve are those of its participant.
  [[nodiscard]] std::array<std::uint8_t, 16> writer_octets() const {
    return wire::octets_of(writer_->guid());
  }
  void send(Bytes bytes) {
    if (!writer_->write(&bytes)) throw std::runtime_error("a request was not sent");
  }
  void fill_in(wire::RequestHeader& header, std::int64_t sequence_number) const {
    header.request_id().writer_guid(wire::octets_of(writer_->guid()));
    header.request_id().sequence_number(sequence_number);
    header.reply_partition(partition_);
    header.contract_version(wire::CONTRACT_VERSION);
  }
  /// As a client that listens in `partition`.
  void send_for(const std::string& partition, Request request, std::int64_t sequence_number) {
    fill_in(request.header(), sequence_number);
    request.header().reply_partition(partition);
    send(to_bytes<typename Operation::Request>(std::move(request)));
  }
  /// With its header filled in.
  void send(Request request, std::int64_t sequence_number) {
    send_for(partition_, std::move(request), sequence_number);
  }
  [[nodiscard]] std::size_t replies() {
    const std::lock_guard lock(mutex_);
    return replies_.size();
  }
  /// Until at least `count` have come.
  [[nodiscard]] std::vector<Reply> wait_for_replies(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kLimit, [&] { return replies_.size() >= count; });
    return replies_;
  }

 private:
  static constexpr std::chrono::seconds kLimit{20};

  void on_publication_matched(wire::dds::DataWriter*,
                              const wire::dds::PublicationMatchedStatus& status) override {
    {
      const std::lock_guard lock(mutex_);
      matched_ = status.current_count;
    }
    changed_.notify_all();
  }
  void on_subscription_matched(wire::dds::DataReader*,
                               const wire::dds::SubscriptionMatchedStatus& status) override {
    {
      const std::lock_guard lock(mutex_);
      answers_ = status.current_count;
    }
    changed_.notify_all();
  }
  void on_data_available(wire::dds::DataReader* reader) override {
    Reply reply;
    wire::dds::SampleInfo info;
    while (reader->take_next_sample(&reply, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      const std::lock_guard lock(mutex_);
      if (info.valid_data) replies_.push_back(reply);
    }
    changed_.notify_all();
  }

  const std::string partition_;
  wire::ParticipantPtr participant_;
  wire::dds::DataWriter* writer_ = nullptr;
  std::mutex mutex_;
  std::condition_variable changed_;
  int matched_ = 0;             // guarded by mutex_: readers of our requests
  int answers_ = 0;             // guarded by mutex_: writers of replies to us
  std::vector<Reply> replies_;  // guarded by mutex_
};

}  // namespace trammel::test
