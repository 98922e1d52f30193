#include "server/dds/state_topics.h"

#include "server/compensate/model_file.h"
#include "server/dds/codec.h"

namespace trammel {
namespace {

template <typename State>
Status open_writer(wire::dds::DomainParticipant& participant, wire::dds::Publisher& publisher,
                   const wire::dds::DataWriterQos& qos, wire::dds::DataWriter*& writer) {
  const auto topic = wire::make_state_topic<State>(participant);
  if (!topic) return tl::make_unexpected(topic.error());
  writer = publisher.create_datawriter(*topic, qos);
  if (writer == nullptr) return failure(ErrorCode::kInternal, "cannot create the writer of {}", State::kName);
  return {};
}

}  // namespace

Result<StateTopics> StateTopics::open(wire::dds::DomainParticipant& participant) {
  wire::dds::Publisher* publisher = participant.create_publisher(wire::publisher_qos({}));
  if (publisher == nullptr) return failure(ErrorCode::kInternal, "cannot create the publisher of the state topics");
  StateTopics topics;
  Status opened = open_writer<wire::ServiceStatusTopic>(participant, *publisher, wire::service_status_writer_qos(),
                                                        topics.service_status_);
  if (opened) {
    opened = open_writer<wire::TrainingProgressTopic>(participant, *publisher, wire::progress_writer_qos(),
                                                      topics.training_progress_);
  }
  if (opened) {
    opened =
        open_writer<wire::ModelStatusTopic>(participant, *publisher, wire::state_writer_qos(), topics.model_status_);
  }
  if (opened) {
    opened = open_writer<wire::ModelSnapshotTopic>(participant, *publisher, wire::state_writer_qos(),
                                                   topics.model_snapshot_);
  }
  if (!opened) return tl::make_unexpected(opened.error());
  return topics;
}

void StateTopics::publish(wire::ServiceStatus status) { service_status_->write(&status); }

void StateTopics::publish(wire::TrainingProgress progress) { training_progress_->write(&progress); }

void StateTopics::publish(const ServedModel& model, const std::string& server_id) {
  wire::ModelStatus status;
  status.cell(model.cell);
  status.server(server_id);
  status.model(to_wire(model, true, unix_now_s()));
  model_status_->write(&status);

  wire::ModelSnapshot snapshot;
  snapshot.cell(model.cell);
  snapshot.server(server_id);
  snapshot.version(model.version);
  snapshot.hash(model.model.provenance().hash);
  snapshot.text(serialize(model.model));
  model_snapshot_->write(&snapshot);
}

}  // namespace trammel
