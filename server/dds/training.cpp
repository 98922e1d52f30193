#include <utility>

#include "server/dds/client_names.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {
namespace {

/// Refuses parameters that do not belong to this kind of training.
Status check_training(const wire::TrainRequest& request) {
  if (request.kind() == wire::TRAIN_BATCHES) {
    if (request.csv().empty()) return {};
    return failure(ErrorCode::kUsage, "a training is of stored batches")
        .of("csv")
        .next("submit the batch first");
  }
  if (request.batch_ids().size() > 1) {
    return failure(ErrorCode::kUsage, "{} batches to diagnose, limit 1", request.batch_ids().size())
        .of("batch_ids")
        .beyond(request.batch_ids().size(), 1);
  }
  for (const auto& [text, field] :
       {std::pair(request.level(), "level"), std::pair(request.bias(), "bias")}) {
    if (text.empty()) continue;
    return failure(ErrorCode::kUsage,
                   "what a diagnosis finds is trained beside what the model in force has")
        .of(field);
  }
  return {};
}

}  // namespace

std::string Handlers::name_of(const std::string& participant) const {
  return names_ == nullptr ? std::string() : names_->of(participant);
}

std::string Handlers::who(const wire::RequestHeader& header) const {
  constexpr std::size_t kOfParticipant = 12;  // octets of a GUID
  const auto& guid = header.request_id().writer_guid();
  const std::string name = name_of({guid.begin(), guid.begin() + kOfParticipant});
  return name.empty() ? requester(header) : name + " " + requester(header);
}

Result<wire::SubmitMeasurementsReply> Handlers::answer(
    const wire::SubmitMeasurementsRequest& request) {
  TRY(subjects_.cell(request.about()));
  if (request.batch_id().empty()) return refused("a batch without an id").of("batch_id");
  const auto job = TRY(trainer_.submit(request.about().cell(), request.batch_id(), request.csv(),
                                       request.change_id().to_string().empty()
                                           ? request_id_text(request.header().request_id())
                                           : request.change_id().to_string(),
                                       who(request.header())));
  wire::SubmitMeasurementsReply reply;
  reply.job(job);
  return reply;
}

Result<wire::TrainReply> Handlers::answer(const wire::TrainRequest& request) {
  if (!request.batch_rule().empty()) return unsupported<wire::TrainReply>("batch_rule");
  if (!request.prior().empty()) return unsupported<wire::TrainReply>("prior");
  if (request.diagnosis() != 0) return unsupported<wire::TrainReply>("diagnosis");
  TRY(subjects_.cell(request.about()));
  const auto job = TRY(trained(request));
  wire::TrainReply reply;
  reply.job(job);
  return reply;
}

Result<std::int64_t> Handlers::trained(const wire::TrainRequest& request) {
  const std::string& cell = request.about().cell();
  const auto& batches = request.batch_ids();
  const bool diagnosed = request.kind() == wire::TRAIN_DIAGNOSED;
  TRY(check_training(request));
  const auto expected = TRY(expected_version(request.change()));
  ChangeId id{request.change().id().to_string(),
              in_few_words(diagnosed ? "diagnose and train" : "train", cell,
                           {fmt::format("{}", fmt::join(batches, "\n")), request.level(),
                            request.bias(), request.csv()}),
              who(request.header())};
  id.expected_version = expected;
  if (!diagnosed)
    return trainer_.retrain(cell, batches, request.level(), request.bias(),
                            Trainer::Quarantine::kStays, id);
  return trainer_.diagnose(cell, batches.empty() ? "" : batches.front(), request.csv(), true, id);
}

bool happens_once(const wire::SubmitMeasurementsRequest&) { return true; }
bool happens_once(const wire::TrainRequest&) { return true; }

}  // namespace trammel
