#include "server/dds/state_topics.h"

#include "server/dds/codec.h"

namespace trammel {
namespace {

Status open_writer(const Result<wire::dds::Topic*>& topic, wire::dds::Publisher& publisher,
                   const wire::dds::DataWriterQos& qos, wire::dds::DataWriter*& writer) {
  if (!topic) return tl::make_unexpected(topic.error());
  writer = publisher.create_datawriter(*topic, qos);
  if (writer == nullptr)
    return failure(ErrorCode::kInternal, "cannot create the writer of {}", (*topic)->get_name());
  return {};
}

}  // namespace

Result<StateTopics> StateTopics::open(wire::dds::DomainParticipant& participant) {
  wire::dds::Publisher* publisher = participant.create_publisher(wire::publisher_qos({}));
  if (publisher == nullptr)
    return failure(ErrorCode::kInternal, "cannot create the publisher of the state topics");
  StateTopics topics;
  Status opened =
      open_writer(wire::make_state_topic<wire::ServiceStatusTopic>(participant), *publisher,
                  wire::service_status_writer_qos(), topics.service_status_);
  if (opened) {
    opened = open_writer(wire::make_contract_topic(participant), *publisher,
                         wire::service_status_writer_qos(), topics.contract_);
  }
  if (opened) {
    opened = open_writer(wire::make_state_topic<wire::TrainingProgressTopic>(participant),
                         *publisher, wire::progress_writer_qos(), topics.training_progress_);
  }
  if (opened) {
    opened = open_writer(wire::make_state_topic<wire::ModelStatusTopic>(participant), *publisher,
                         wire::state_writer_qos(), topics.model_status_);
  }
  if (!opened) return tl::make_unexpected(opened.error());
  return topics;
}

void StateTopics::publish(wire::ServiceStatus status) {
  wire::SpokenContract contract;
  contract.server(status.server());
  contract.contract_version(status.contract_version());
  contract.program_version(status.program_version());
  contract_->write(&contract);
  service_status_->write(&status);
}

void StateTopics::publish(wire::TrainingProgress progress) { training_progress_->write(&progress); }

void StateTopics::publish(const ServedModel& model, const std::string& server_id) {
  wire::ModelStatus status;
  status.cell(model.cell);
  status.server(server_id);
  status.model(to_wire(model, true, unix_now_s()));
  status.model().budget(budget_to_wire(model));
  model_status_->write(&status);
}

}  // namespace trammel
