#pragma once

#include <string>

#include "idl/transport/transport.h"
#include "server/registry/model_registry.h"

namespace trammel {

/// The writers of the state topics. Thread-safe.
class StateTopics {
 public:
  [[nodiscard]] static Result<StateTopics> open(wire::dds::DomainParticipant& participant);

  [[nodiscard]] const wire::dds::DataWriter& status_writer() const { return *service_status_; }

  /// Writes it, and the contract for clients of every contract.
  void publish(wire::ServiceStatus status);
  void publish(wire::TrainingProgress progress);
  /// Writes ModelStatus.
  void publish(const ServedModel& model, const std::string& server_id);

 private:
  StateTopics() = default;
  wire::dds::DataWriter* service_status_ = nullptr;
  wire::dds::DataWriter* contract_ = nullptr;
  wire::dds::DataWriter* training_progress_ = nullptr;
  wire::dds::DataWriter* model_status_ = nullptr;
};

}  // namespace trammel
