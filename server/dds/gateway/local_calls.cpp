#include "server/dds/gateway/local_calls.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <random>
#include <utility>

#include "idl/exchange/wire_values.h"
#include "server/exchange/si.h"

namespace trammel {
namespace {

constexpr const char* kBeginning = "HTTP";  // of the GUIDs of these clients

wire::Context context_of_call(const CallAbout& about) {
  wire::Context context;
  context.cell(about.cell);
  context.tool(about.tool);
  context.payload(about.payload);
  context.controller_compensates(about.controller_compensates);
  context.model(about.model);
  return context;
}

template <typename Request>
Request request_about(const CallAbout& about) {
  Request request;
  request.about(context_of_call(about));
  return request;
}

/// The request that queues a job for a batch.
template <typename Request>
Request request_with(const CallAbout& about, const SentBatch& batch) {
  auto request = request_about<Request>(about);
  request.change_id(batch.change_id);
  request.batch_id(batch.batch_id);
  request.csv(batch.csv);
  return request;
}

wire::ReadModelsRequest question_about(const CallAbout& about, wire::ReadKind what) {
  auto request = request_about<wire::ReadModelsRequest>(about);
  request.what(what);
  request.since_unix_s(-1);
  return request;
}

/// Those of the cell's robot; none where the server does not know it.
exchange::Rails rails_of_cell(const Trainer& trainer, const std::string& cell) {
  const ServedCells& cells = trainer.cells();
  const auto found = cells.find(cell);
  return found == cells.end() ? exchange::Rails() : exchange::rails_of(found->second->robot);
}

}  // namespace

LocalClients::LocalClients(ClientNames& names)
    : names_(names), secret_([] {
        std::random_device random;
        return std::uint64_t{random()} << 32 | random();
      }()) {}

std::string LocalClients::participant_of(const std::string& client) {
  std::string participant = kBeginning;
  std::uint64_t hash = secret_ ^ std::hash<std::string>{}(client + std::to_string(secret_));
  for (int i = 0; i < 8; ++i, hash >>= 8) participant += static_cast<char>(hash & 0xff);
  names_.called(participant, client);
  return participant;
}

LocalCalls::LocalCalls(ServiceCore& service, ClientNames& names, const AllLanes& lanes)
    : trainer_(service.trainer),
      server_id_(service.server_id),
      clients_(names),
      core_{service, clients_, replies_},
      predict_(core_, {lanes.predictions, lanes.predictions}),
      correct_(core_, {lanes.corrections, lanes.corrections}),
      submit_(core_, {lanes.changes, lanes.reads}),
      train_(core_, {lanes.changes, lanes.reads}),
      diagnose_(core_, {lanes.changes, lanes.reads}),
      check_(core_, {lanes.changes, lanes.reads}),
      read_(core_, {lanes.changes, lanes.reads}),
      manage_(core_, {lanes.changes, lanes.reads}) {}

std::array<const RequestEndpointBase*, 8> LocalCalls::endpoints() const {
  return {&predict_, &correct_, &submit_, &train_, &diagnose_, &check_, &read_, &manage_};
}

LocalCalls::Answers<exchange::Prediction> LocalCalls::predict(
    const CallFrom& from, const CallAbout& about, const std::vector<exchange::AskedJoints>& poses,
    CallOutcome& outcome) {
  auto request = request_about<wire::PredictErrorRequest>(about);
  for (const exchange::AskedJoints& pose : poses) request.poses().push_back(wire::to_wire(pose));
  const auto reply = TRY(predict_.ask(std::move(request), from, outcome));
  exchange::Answer<exchange::Prediction> answer{wire::from_wire(reply.model()), {}};
  for (const wire::PredictedError& one : reply.predictions())
    answer.items.push_back(wire::from_wire(one));
  return answer;
}

LocalCalls::Answers<exchange::CorrectedTarget> LocalCalls::correct(
    const CallFrom& from, const CallAbout& about, const std::vector<exchange::AskedTarget>& targets,
    CallOutcome& outcome) {
  auto request = request_about<wire::CorrectTargetRequest>(about);
  for (const exchange::AskedTarget& target : targets)
    request.targets().push_back(wire::to_wire(target));
  const auto reply = TRY(correct_.ask(std::move(request), from, outcome));
  const exchange::Rails rails = rails_of_cell(trainer_, about.cell);
  exchange::Answer<exchange::CorrectedTarget> answer{wire::from_wire(reply.model()), {}};
  for (const wire::CorrectedTarget& one : reply.corrections())
    answer.items.push_back(wire::from_wire(one, rails));
  return answer;
}

Result<std::int64_t> LocalCalls::submit(const CallFrom& from, const CallAbout& about,
                                        const SentBatch& batch, CallOutcome& outcome) {
  const auto reply =
      TRY(submit_.ask(request_with<wire::SubmitMeasurementsRequest>(about, batch), from, outcome));
  return reply.job();
}

Result<std::int64_t> LocalCalls::train(const CallFrom& from, const CallAbout& about,
                                       const Training& training, CallOutcome& outcome) {
  auto request = request_about<wire::TrainRequest>(about);
  request.change().id(training.change_id);
  request.change().expected_version(-1);
  request.kind(wire::TRAIN_BATCHES);
  request.batch_ids(training.batch_ids);
  request.level(training.level);
  request.bias(training.bias);
  const auto reply = TRY(train_.ask(std::move(request), from, outcome));
  return reply.job();
}

Result<std::int64_t> LocalCalls::diagnose(const CallFrom& from, const CallAbout& about,
                                          const SentBatch& batch, CallOutcome& outcome) {
  const auto reply =
      TRY(diagnose_.ask(request_with<wire::DiagnoseRequest>(about, batch), from, outcome));
  return reply.job();
}

Result<std::int64_t> LocalCalls::check(const CallFrom& from, const CallAbout& about,
                                       const SentBatch& batch, std::optional<double> tolerance_mm,
                                       CallOutcome& outcome) {
  auto request = request_with<wire::CheckHealthRequest>(about, batch);
  request.tolerance_mm(tolerance_mm.value_or(std::numeric_limits<double>::quiet_NaN()));
  const auto reply = TRY(check_.ask(std::move(request), from, outcome));
  return reply.job();
}

Result<exchange::ModelInfo> LocalCalls::activate(const CallFrom& from, const CallAbout& about,
                                                 const Activation& change, CallOutcome& outcome) {
  auto request = request_about<wire::ManageModelsRequest>(about);
  request.action(change.version ? wire::MANAGE_ACTIVATE : wire::MANAGE_ROLLBACK);
  request.version(change.version.value_or(0));
  request.force(change.force);
  request.reason(change.reason);
  request.change().id(change.change_id);
  request.change().expected_version(change.expected_version.value_or(-1));
  const auto reply = TRY(manage_.ask(std::move(request), from, outcome));
  return wire::from_wire(reply.model());
}

Result<std::vector<exchange::ModelInfo>> LocalCalls::models(const CallFrom& from,
                                                            const CallAbout& about,
                                                            CallOutcome& outcome) {
  const auto reply = TRY(read_.ask(question_about(about, wire::READ_MODELS), from, outcome));
  std::vector<exchange::ModelInfo> models;
  for (const wire::ModelInfo& model : reply.models()) models.push_back(wire::from_wire(model));
  return models;
}

Result<std::vector<exchange::DatedJob>> LocalCalls::jobs(const CallFrom& from,
                                                         const CallAbout& about, std::int64_t job,
                                                         CallOutcome& outcome) {
  auto request = question_about(about, job > 0 ? wire::READ_JOB : wire::READ_JOBS);
  request.job(job);
  const auto reply = TRY(read_.ask(std::move(request), from, outcome));
  std::vector<exchange::DatedJob> jobs;
  for (const wire::Job& one : reply.jobs()) jobs.push_back(wire::from_wire(one, server_id_));
  return jobs;
}

Result<std::string> LocalCalls::findings(const CallFrom& from, const CallAbout& about,
                                         std::int64_t job, CallOutcome& outcome) {
  auto request = question_about(about, wire::READ_FINDINGS);
  request.job(job);
  auto reply = TRY(read_.ask(std::move(request), from, outcome));
  return std::move(reply.text());
}

Result<std::string> LocalCalls::fleet(const CallFrom& from, CallOutcome& outcome) {
  auto reply = TRY(read_.ask(question_about({}, wire::READ_FLEET), from, outcome));
  return std::move(reply.text());
}

}  // namespace trammel
