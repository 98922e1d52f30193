#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {

Result<wire::SubmitMeasurementsReply> Handlers::answer(const wire::SubmitMeasurementsRequest& request) {
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  if (request.batch_id().empty()) return refused("a batch without an id").of("batch_id");
  const auto job = trainer_.submit(request.about().cell(), request.batch_id(), request.csv(),
                                   request_id_text(request.header().request_id()));
  if (!job) return tl::make_unexpected(job.error());
  wire::SubmitMeasurementsReply reply;
  reply.job(*job);
  return reply;
}

Result<wire::TrainReply> Handlers::answer(const wire::TrainRequest& request) {
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  if (request.batch_ids().size() > wire::MAX_BATCHES) {
    return failure(ErrorCode::kTooLarge, "{} batches in one request, limit {}", request.batch_ids().size(),
                   wire::MAX_BATCHES)
        .of("batch_ids")
        .beyond(request.batch_ids().size(), wire::MAX_BATCHES);
  }
  const auto job = trainer_.retrain(request.about().cell(), request.batch_ids(), request.level(), request.bias());
  if (!job) return tl::make_unexpected(job.error());
  wire::TrainReply reply;
  reply.job(*job);
  return reply;
}

bool happens_once(const wire::SubmitMeasurementsRequest&) { return true; }
bool happens_once(const wire::TrainRequest&) { return true; }

}  // namespace trammel
