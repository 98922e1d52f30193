#include <utility>

#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {

Result<wire::SubmitMeasurementsReply> Handlers::answer(const wire::SubmitMeasurementsRequest& request) {
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  if (request.batch_id().empty()) return refused("a batch without an id").of("batch_id");
  const auto job =
      trainer_.submit(request.about().cell(), request.batch_id(), request.csv(),
                      request.change_id().to_string().empty() ? request_id_text(request.header().request_id())
                                                              : request.change_id().to_string());
  if (!job) return tl::make_unexpected(job.error());
  wire::SubmitMeasurementsReply reply;
  reply.job(*job);
  return reply;
}

Result<wire::TrainReply> Handlers::answer(const wire::TrainRequest& request) {
  if (!request.batch_rule().empty()) return unsupported<wire::TrainReply>("batch_rule");
  if (!request.prior().empty()) return unsupported<wire::TrainReply>("prior");
  if (request.diagnosis() != 0) return unsupported<wire::TrainReply>("diagnosis");
  if (request.change().expected_epoch() != 0) return unsupported<wire::TrainReply>("expected_epoch");
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  const auto job = request.kind() == wire::TRAIN_DIAGNOSED ? train_diagnosed(request) : train_from_batches(request);
  if (!job) return tl::make_unexpected(job.error());
  wire::TrainReply reply;
  reply.job(*job);
  return reply;
}

Result<std::int64_t> Handlers::train_from_batches(const wire::TrainRequest& request) {
  if (!request.csv().empty())
    return failure(ErrorCode::kUsage, "a training is of stored batches").of("csv").next("submit the batch first");
  return trainer_.retrain(request.about().cell(), request.batch_ids(), request.level(), request.bias());
}

Result<std::int64_t> Handlers::train_diagnosed(const wire::TrainRequest& request) {
  const auto& batches = request.batch_ids();
  if (batches.size() > 1) {
    return failure(ErrorCode::kUsage, "{} batches to diagnose, limit 1", batches.size())
        .of("batch_ids")
        .beyond(batches.size(), 1);
  }
  for (const auto& [text, field] : {std::pair(request.level(), "level"), std::pair(request.bias(), "bias")}) {
    if (!text.empty())
      return failure(ErrorCode::kUsage, "what a diagnosis finds is trained beside what the model in force has")
          .of(field);
  }
  return trainer_.diagnose(request.about().cell(), batches.empty() ? "" : batches.front(), request.csv(), true);
}

bool happens_once(const wire::SubmitMeasurementsRequest&) { return true; }
bool happens_once(const wire::TrainRequest&) { return true; }

}  // namespace trammel
