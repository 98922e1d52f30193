#pragma once

#include <string>

#include "idl/transport.h"
#include "server/registry/model_registry.h"

namespace trammel {

/// The writers of what a server says without being asked. Thread-safe.
class StateTopics {
 public:
  [[nodiscard]] static Result<StateTopics> open(wire::dds::DomainParticipant& participant);

  [[nodiscard]] const wire::dds::DataWriter& status_writer() const { return *service_status_; }

  void publish(wire::ServiceStatus status);
  void publish(wire::TrainingProgress progress);
  /// ModelStatus and ModelSnapshot; a model too large for a sample has only the former.
  void publish(const ServedModel& model, const std::string& server_id);

 private:
  StateTopics() = default;
  wire::dds::DataWriter* service_status_ = nullptr;
  wire::dds::DataWriter* training_progress_ = nullptr;
  wire::dds::DataWriter* model_status_ = nullptr;
  wire::dds::DataWriter* model_snapshot_ = nullptr;
};

}  // namespace trammel
