#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "idl/transport/transport.h"
#include "trammel_msgsPubSubTypes.h"

/// Predictions and corrections for ROS 2 nodes (ros2/trammel_msgs): topics and types are named as
/// ROS 2 names them on DDS, what correlates travels in the messages, and there is no partition.
namespace trammel::wire {

namespace ros2 = trammel_msgs::msg::dds_;

template <>
[[nodiscard]] std::optional<Fault> find_fault<ros2::PredictErrors_>(
    std::span<const unsigned char> sample);
template <>
[[nodiscard]] std::optional<Fault> find_fault<ros2::PredictedErrors_>(
    std::span<const unsigned char> sample);
template <>
[[nodiscard]] std::optional<Fault> find_fault<ros2::CorrectTargets_>(
    std::span<const unsigned char> sample);
template <>
[[nodiscard]] std::optional<Fault> find_fault<ros2::CorrectedTargets_>(
    std::span<const unsigned char> sample);

/// An operation under the names of ROS 2: its topics are `rt/trammel/...` (in ROS 2:
/// `/trammel/...`).
struct Ros2PredictErrors {
  using Operation = PredictError;
  using Request = ros2::PredictErrors_PubSubType;
  using Reply = ros2::PredictedErrors_PubSubType;
  static constexpr const char* kName = "Ros2PredictErrors";
  static constexpr const char* kRequestTopic = "rt/trammel/predict_errors";
  static constexpr const char* kReplyTopic = "rt/trammel/predicted_errors";
};
struct Ros2CorrectTargets {
  using Operation = CorrectTarget;
  using Request = ros2::CorrectTargets_PubSubType;
  using Reply = ros2::CorrectedTargets_PubSubType;
  static constexpr const char* kName = "Ros2CorrectTargets";
  static constexpr const char* kRequestTopic = "rt/trammel/correct_targets";
  static constexpr const char* kReplyTopic = "rt/trammel/corrected_targets";
};

/// A question of a ROS 2 node as a server receives it.
template <typename Message>
struct ReceivedMessage : Message {
  std::optional<Fault> fault = {};  ///< why it cannot be carried out; then only its id is read
  std::size_t bytes = 0;            ///< serialized
  ContentId content = {};
};

/// The id with which a message begins; empty: there is none that could be answered.
[[nodiscard]] std::string message_id(std::span<const unsigned char> sample);

/// The type of questions on the side of the server: whoever sent an id that can be read is told
/// what is wrong.
template <typename PubSubType>
class ReceivedMessageType final : public SafeType<PubSubType> {
 public:
  using Message = typename PubSubType::type;

  /// `unreadable` counts the samples that are dropped.
  ReceivedMessageType(std::size_t max_sample,
                      std::shared_ptr<std::atomic<std::uint64_t>> unreadable)
      : SafeType<PubSubType>(max_sample), unreadable_(std::move(unreadable)) {}

  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    auto& received = *static_cast<ReceivedMessage<Message>*>(data);
    received = {};
    const std::span<const unsigned char> bytes = bytes_of(*payload);
    const std::string id = message_id(bytes);
    if (id.empty()) {
      ++*unreadable_;
      return false;
    }
    received.bytes = bytes.size();
    received.content.hash =
        std::hash<std::string_view>{}({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    received.fault = fault_of(bytes);
    if (!received.fault && !this->deserialize_unseen(payload, static_cast<Message*>(&received)))
      received.fault = Fault{RESULT_MALFORMED, "the sample cannot be read", {}, {}, {}, {}};
    received.id(id);
    return true;
  }

  void* createData() override { return new ReceivedMessage<Message>; }
  void deleteData(void* data) override { delete static_cast<ReceivedMessage<Message>*>(data); }

 private:
  [[nodiscard]] std::optional<Fault> fault_of(std::span<const unsigned char> bytes) const {
    return this->is_too_large(bytes) ? this->too_large(bytes) : find_fault<Message>(bytes);
  }

  const std::shared_ptr<std::atomic<std::uint64_t>> unreadable_;
};

}  // namespace trammel::wire
