// The changes that a session requests from a server: batches, trainings, versions in force.
#include <algorithm>

#include "clients/session/participant.h"

namespace trammel::client {
namespace {

/// Refuses a text with a NUL: strings on the wire end there, and the rest would be lost silently.
Status check_text(const std::string& what, const std::string& text) {
  if (const std::size_t nul = text.find('\0'); nul != std::string::npos) {
    const auto line =
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(nul), '\n');
    return refused("a NUL byte, not text").in(what).at_row(line);
  }
  if (text.size() <= wire::kMaxText) return {};
  return failure(ErrorCode::kTooLarge, "{} bytes, limit {}", text.size(), wire::kMaxText)
      .in(what)
      .beyond(text.size(), wire::kMaxText);
}

wire::TrainRequest training_of_diagnosis(const std::string& cell, const std::string& batch_id,
                                         const std::string& csv, const ChangeOptions& change) {
  wire::TrainRequest request;
  request.about().cell(cell);
  request.change(to_wire(change));
  request.kind(wire::TRAIN_DIAGNOSED);
  if (!batch_id.empty()) request.batch_ids({batch_id});
  request.csv(csv);
  return request;
}

}  // namespace

Result<std::int64_t> Session::submit_measurements(const std::string& cell,
                                                  const std::string& batch_id,
                                                  const std::string& csv) {
  TRY(check_text("batch " + batch_id, csv));
  wire::SubmitMeasurementsRequest request;
  request.change_id(make_name("change"));
  request.about().cell(cell);
  request.batch_id(batch_id);
  request.csv(csv);
  const auto reply =
      TRY(participant_->call<wire::SubmitMeasurements>(std::move(request), {cell, {}, true}));
  return participant_->accepted(reply);
}

Result<std::int64_t> Session::train(const std::string& cell,
                                    const std::vector<std::string>& batch_ids,
                                    const std::string& level, const std::string& bias,
                                    const ChangeOptions& change) {
  wire::TrainRequest request;
  request.about().cell(cell);
  request.change(to_wire(change));
  request.batch_ids(batch_ids);
  request.level(level);
  request.bias(bias);
  const auto reply = TRY(participant_->call<wire::Train>(std::move(request), {cell, {}, true}));
  return participant_->accepted(reply);
}

Result<std::int64_t> Session::diagnose(const std::string& cell, const std::string& batch_id,
                                       const std::string& csv, bool apply,
                                       const ChangeOptions& change) {
  TRY(check_text("the batch", csv));
  const Route route{cell, {}, true};
  if (apply) {
    const auto reply = TRY(
        participant_->call<wire::Train>(training_of_diagnosis(cell, batch_id, csv, change), route));
    return participant_->accepted(reply);
  }
  wire::DiagnoseRequest request;
  request.about().cell(cell);
  request.change_id(change_id(change));
  request.batch_id(batch_id);
  request.csv(csv);
  const auto reply = TRY(participant_->call<wire::Diagnose>(std::move(request), route));
  return participant_->accepted(reply);
}

Result<std::int64_t> Session::check_health(const std::string& cell, const std::string& batch_id,
                                           const std::string& csv, double tolerance_mm,
                                           const ChangeOptions& change) {
  TRY(check_text("the batch", csv));
  wire::CheckHealthRequest request;
  request.about().cell(cell);
  request.change_id(change_id(change));
  request.batch_id(batch_id);
  request.csv(csv);
  request.tolerance_mm(tolerance_mm);
  const auto reply =
      TRY(participant_->call<wire::CheckHealth>(std::move(request), Route{cell, {}, true}));
  return participant_->accepted(reply);
}

Status Session::release(const std::string& cell, const std::string& batch_id,
                        const ChangeOptions& change) {
  return participant_->release(cell, {batch_id}, change, {}).map([](std::int64_t) {});
}

Status Session::discard(const std::string& cell, const std::string& batch_id,
                        const ChangeOptions& change) {
  wire::ReleaseBatchesRequest request;
  request.action(wire::RELEASE_DISCARD);
  return participant_->release(cell, {batch_id}, change, std::move(request)).map([](std::int64_t) {
  });
}

Result<std::int64_t> Session::release_and_train(const std::string& cell,
                                                const std::vector<std::string>& batch_ids,
                                                const std::string& level, const std::string& bias,
                                                const ChangeOptions& change) {
  wire::ReleaseBatchesRequest request;
  request.action(wire::RELEASE_AND_TRAIN);
  request.level(level);
  request.bias(bias);
  return participant_->release(cell, batch_ids, change, std::move(request));
}

Result<int> Session::activate(const std::string& cell, int version, const ChangeOptions& change) {
  wire::ManageModelsRequest request;
  request.version(version);
  request.force(change.force);
  const auto reply =
      TRY(participant_->manage(cell, wire::MANAGE_ACTIVATE, change, std::move(request)));
  return reply.version();
}

Status Session::cancel(std::int64_t job) {
  const auto found = TRY(participant_->find_job(job));
  wire::ManageModelsRequest request;
  request.job(job);
  return participant_
      ->manage(found.second.cell(), wire::MANAGE_CANCEL_JOB, {}, std::move(request), found.first)
      .map([](const auto&) {});
}

Result<int> Session::rollback(const std::string& cell, const ChangeOptions& change) {
  const auto reply = TRY(participant_->manage(cell, wire::MANAGE_ROLLBACK, change));
  return reply.version();
}

Result<int> Session::import_model(const std::string& cell, const std::string& text,
                                  const ChangeOptions& change) {
  TRY(check_text("the model", text));
  wire::ManageModelsRequest request;
  request.model_text(text);
  const auto reply =
      TRY(participant_->manage(cell, wire::MANAGE_IMPORT, change, std::move(request)));
  return reply.version();
}

}  // namespace trammel::client
