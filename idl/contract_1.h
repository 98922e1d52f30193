#pragma once

#include <optional>
#include <span>
#include <string>

#include "contract_1PubSubTypes.h"
#include "idl/transport.h"

/// The topics of contract 1 (contract_1.idl): where older clients are told that they must be updated, and where clients
/// of every age read which contract a server speaks.
namespace trammel::wire {

template <>
[[nodiscard]] std::optional<Fault> find_fault<contract_1::Request>(std::span<const unsigned char> sample);
template <>
[[nodiscard]] std::optional<Fault> find_fault<contract_1::ComputedReply>(std::span<const unsigned char> sample);
template <>
[[nodiscard]] std::optional<Fault> find_fault<contract_1::QueuedReply>(std::span<const unsigned char> sample);
template <>
[[nodiscard]] std::optional<Fault> find_fault<contract_1::DiagnoseReply>(std::span<const unsigned char> sample);
template <>
[[nodiscard]] std::optional<Fault> find_fault<contract_1::ManageModelsReply>(std::span<const unsigned char> sample);
template <>
[[nodiscard]] std::optional<Fault> find_fault<contract_1::ServiceStatus>(std::span<const unsigned char> sample);

/// The operations of contract 1, each with `<name>_Request` and `<name>_Reply`, and the type of a reply that has only a
/// header to tell.
struct OldPredictError {
  using Reply = contract_1::ComputedReplyPubSubType;
  static constexpr const char* kName = "PredictError";
};
struct OldCorrectTarget {
  using Reply = contract_1::ComputedReplyPubSubType;
  static constexpr const char* kName = "CorrectTarget";
};
struct OldSubmitMeasurements {
  using Reply = contract_1::QueuedReplyPubSubType;
  static constexpr const char* kName = "SubmitMeasurements";
};
struct OldTrain {
  using Reply = contract_1::QueuedReplyPubSubType;
  static constexpr const char* kName = "Train";
};
struct OldDiagnose {
  using Reply = contract_1::DiagnoseReplyPubSubType;
  static constexpr const char* kName = "Diagnose";
};
struct OldManageModels {
  using Reply = contract_1::ManageModelsReplyPubSubType;
  static constexpr const char* kName = "ManageModels";
};

/// `ServiceStatus` as contract 1 has it: published by every server, for clients of every contract.
struct OldServiceStatusTopic {
  using Type = contract_1::ServiceStatusPubSubType;
  static constexpr const char* kName = "ServiceStatus";
};

/// The name of a type of contract 1 on the wire.
[[nodiscard]] std::string old_type_name(const std::string& type);

/// Its samples are contract_1::Request, whatever followed in the request.
template <typename Operation>
[[nodiscard]] Result<dds::Topic*> make_old_request_topic(dds::DomainParticipant& participant) {
  const std::string name = Operation::kName;
  return make_topic(participant, name + "_Request", new SafeType<contract_1::RequestPubSubType>(kMaxTextSample),
                    old_type_name(name + "Request"));
}
template <typename Operation>
[[nodiscard]] Result<dds::Topic*> make_old_reply_topic(dds::DomainParticipant& participant) {
  const std::string name = Operation::kName;
  return make_topic(participant, name + "_Reply", new SafeType<typename Operation::Reply>(kMaxStateSample),
                    old_type_name(name + "Reply"));
}
[[nodiscard]] Result<dds::Topic*> make_old_status_topic(dds::DomainParticipant& participant);

}  // namespace trammel::wire
