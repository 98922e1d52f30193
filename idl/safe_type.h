#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <fastdds/dds/topic/TopicDataType.hpp>

#include "idl/valid.h"
#include "server/base/mutex.h"

namespace trammel::wire {

/// A generated PubSubType that survives hostile bytes: one that throws while it reads would leave the sample in the
/// reader and throw again at every take; one that does not look at sizes and enumerators lets them through. Here such a
/// sample is dropped and the reader goes on. Also guards the key buffer that all writers of a type share.
template <typename PubSubType>
class SafeType : public PubSubType {
 public:
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
    if (payload->length > max_sample_) return false;
    try {
      return PubSubType::deserialize(payload, data) && valid(*static_cast<typename PubSubType::type*>(data));
    } catch (...) {
      return false;
    }
  }

  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle, bool force_md5) override {
    const MutexLock lock(key_mutex_);
    try {
      return PubSubType::getKey(data, handle, force_md5);
    } catch (...) {
      return false;
    }
  }

 private:
  /// What a history sets aside for a sample before it knows its size; the generated figure assumes full sequences.
  static constexpr std::uint32_t kReservedBytes = 4096;

  const std::size_t max_sample_;
  Mutex key_mutex_;  // the key buffer in PubSubType
};

}  // namespace trammel::wire
