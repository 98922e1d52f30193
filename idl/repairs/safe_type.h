#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "idl/limits.h"
#include "idl/repairs/guard/cut_sample.h"
#include "idl/repairs/valid.h"
#include "server/base/mutex.h"

namespace trammel::wire {

[[nodiscard]] inline std::span<const unsigned char> bytes_of(
    const eprosima::fastrtps::rtps::SerializedPayload_t& payload) {
  return {payload.data, payload.length};
}

/// A generated PubSubType that survives hostile bytes. The generated code may throw while it reads:
/// then the sample stays in the reader and every later take throws again. It also believes lengths
/// and accepts unknown enumerators. Here such samples are dropped and the reader goes on. Also
/// guards the key buffer that all writers of a type share.
template <typename PubSubType>
class SafeType : public PubSubType {
 public:
  using Sample = typename PubSubType::type;

  explicit SafeType(std::size_t max_sample) : max_sample_(max_sample) {
    this->m_typeSize = std::min<std::uint32_t>(this->m_typeSize, kReservedBytes);
  }

  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    try {
      return PubSubType::serialize(data, payload) && payload->length <= max_sample_;
    } catch (...) {
      return false;
    }
  }

  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    if (is_too_large(bytes_of(*payload)) || find_fault<Sample>(bytes_of(*payload))) return false;
    return deserialize_unseen(payload, data);
  }

  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle,
              bool force_md5) override {
    const MutexLock lock(key_mutex_);
    try {
      return PubSubType::getKey(data, handle, force_md5);
    } catch (...) {
      return false;
    }
  }

 protected:
  [[nodiscard]] bool is_too_large(std::span<const unsigned char> sample) const {
    return whole_size(sample) > max_sample_;
  }
  [[nodiscard]] Fault too_large(std::span<const unsigned char> sample) const {
    Fault fault{RESULT_TOO_LARGE, "the request is too large", {}, {}, {}, {}};
    fault.value = static_cast<double>(whole_size(sample));
    fault.limit = static_cast<double>(max_sample_);
    return fault;
  }

  bool deserialize_unseen(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) {
    try {
      return PubSubType::deserialize(payload, data);
    } catch (...) {
      return false;
    }
  }

  const std::size_t max_sample_;

 private:
  /// Bytes that a history reserves for a sample of unknown size. The generated figure assumes full
  /// sequences.
  static constexpr std::uint32_t kReservedBytes = 4096;

  Mutex key_mutex_;  // the key buffer in PubSubType
};

/// The content of a request without its header: the bytes behind it. Their padding depends on where
/// they begin.
struct ContentId {
  std::size_t hash = 0;
  std::size_t alignment = 0;

  /// Surely not the same request. Repeats whose headers differ in length are taken for the same.
  [[nodiscard]] bool is_other_than(const ContentId& other) const {
    return alignment == other.alignment && hash != other.hash;
  }
};

/// A request as a server receives it.
template <typename Request>
struct Received : Request {
  /// Why it cannot be carried out; then only its header is read.
  std::optional<Fault> fault = {};
  std::size_t bytes = 0;  ///< serialized
  ContentId content = {};
};

/// The type of requests on the side of the server, whose samples are Received: whoever sent a
/// header that can be read is told what is wrong with the rest.
template <typename PubSubType>
class ReceivedType final : public SafeType<PubSubType> {
 public:
  using Request = typename PubSubType::type;

  /// `unreadable` counts the samples that are dropped.
  ReceivedType(std::size_t max_sample, std::shared_ptr<std::atomic<std::uint64_t>> unreadable)
      : SafeType<PubSubType>(max_sample), unreadable_(std::move(unreadable)) {}

  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    auto& received = *static_cast<Received<Request>*>(data);
    received = {};
    received.bytes = payload->length;
    if (!read_header(payload, received.header(), received.content)) {
      ++*unreadable_;
      return false;
    }
    received.fault = fault_of(*payload, received.header());
    if (!is_token(received.header().trace_id().c_str())) received.header().trace_id("");
    if (received.fault || this->deserialize_unseen(payload, static_cast<Request*>(&received)))
      return true;
    received.fault = Fault{RESULT_MALFORMED, "the sample cannot be read", {}, {}, {}, {}};
    return true;
  }

  void* createData() override { return new Received<Request>; }
  void deleteData(void* data) override { delete static_cast<Received<Request>*>(data); }

 private:
  /// A header that names no partition cannot be answered.
  static bool read_header(eprosima::fastrtps::rtps::SerializedPayload_t* payload,
                          RequestHeader& header, ContentId& content) {
    if (find_fault<RequestHeader>(bytes_of(*payload))) return false;
    try {
      eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
      eprosima::fastcdr::Cdr reader(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN,
                                    eprosima::fastcdr::Cdr::DDS_CDR);
      reader.read_encapsulation();
      header.deserialize(reader);
      const std::size_t at = reader.getSerializedDataLength();
      constexpr std::size_t kLargestAlignment = 8;
      const std::string_view rest(buffer.getBuffer() + at, payload->length - at);
      content = {std::hash<std::string_view>{}(rest), at % kLargestAlignment};
    } catch (...) {
      return false;
    }
    return valid_partition(header.reply_partition().to_string());
  }

  [[nodiscard]] std::optional<Fault> fault_of(
      const eprosima::fastrtps::rtps::SerializedPayload_t& payload,
      const RequestHeader& header) const {
    if (header.contract_version() != CONTRACT_VERSION)
      return fault_of_contract(header.contract_version());
    return this->is_too_large(bytes_of(payload)) ? this->too_large(bytes_of(payload))
                                                 : find_fault<Request>(bytes_of(payload));
  }

  const std::shared_ptr<std::atomic<std::uint64_t>> unreadable_;
};

}  // namespace trammel::wire
