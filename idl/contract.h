#pragma once

#include <optional>
#include <span>

#include "contractPubSubTypes.h"
#include "idl/transport.h"

/// Which contract a server speaks: the one type that no contract changes.
namespace trammel::wire {

struct SpokenContractTopic {
  using Type = SpokenContractPubSubType;
  static constexpr const char* kName = "SpokenContract";
};

template <>
[[nodiscard]] std::optional<Fault> find_fault<SpokenContract>(std::span<const unsigned char> sample);

[[nodiscard]] Result<dds::Topic*> make_contract_topic(dds::DomainParticipant& participant);

}  // namespace trammel::wire
