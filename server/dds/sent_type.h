#pragma once

#include "idl/transport/transport.h"

namespace trammel {

/// The type of replies on the server's side. A reply that a client would drop is not written, so
/// that the server can send an error instead.
template <typename PubSubType>
class SentType final : public wire::SafeType<PubSubType> {
 public:
  using wire::SafeType<PubSubType>::SafeType;

  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    return wire::SafeType<PubSubType>::serialize(data, payload) &&
           !wire::find_fault<typename PubSubType::type>(wire::bytes_of(*payload));
  }
};

template <typename Operation>
[[nodiscard]] Result<wire::dds::Topic*> make_sent_topic(wire::dds::DomainParticipant& participant) {
  return wire::make_topic(participant, wire::topic_name(Operation::kName, "_Reply"),
                          new SentType<typename Operation::Reply>(Operation::kMaxSample));
}

}  // namespace trammel
