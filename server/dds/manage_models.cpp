#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {

Result<wire::ManageModelsReply> Handlers::answer(const wire::ManageModelsRequest& request) {
  if (request.force()) return unsupported<wire::ManageModelsReply>("force");
  if (request.change().expected_epoch() != 0) return unsupported<wire::ManageModelsReply>("expected_epoch");
  if (request.action() > wire::MANAGE_IMPORT) return unsupported<wire::ManageModelsReply>("action");
  const std::string& cell = request.about().cell();
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  const auto version = changed(cell, request);
  if (!version) return tl::make_unexpected(version.error());
  wire::ManageModelsReply reply;
  reply.version(*version);
  if (const auto served = registry_.in_force(cell)) reply.model(to_wire(*served, true, unix_now_s()));
  return reply;
}

Result<int> Handlers::changed(const std::string& cell, const wire::ManageModelsRequest& request) {
  if (request.action() == wire::MANAGE_ROLLBACK) return trainer_.rollback(cell);
  if (request.action() == wire::MANAGE_IMPORT) return trainer_.import_model(cell, request.model_text());
  return trainer_.activate(cell, request.version()).map([&] { return int{request.version()}; });
}

Result<wire::ReleaseBatchesReply> Handlers::answer(const wire::ReleaseBatchesRequest& request) {
  if (request.action() == wire::RELEASE_DISCARD) return unsupported<wire::ReleaseBatchesReply>("action");
  if (request.change().expected_epoch() != 0) return unsupported<wire::ReleaseBatchesReply>("expected_epoch");
  const std::string& cell = request.about().cell();
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  wire::ReleaseBatchesReply reply;
  if (request.action() == wire::RELEASE_AND_TRAIN) {
    const auto job =
        trainer_.retrain(cell, request.batch_ids(), request.level(), request.bias(), Trainer::Quarantine::kReleased);
    if (!job) return tl::make_unexpected(job.error());
    reply.job(*job);
    return reply;
  }
  if (request.batch_ids().size() != 1) {
    return failure(ErrorCode::kUsage, "{} batches to release, 1 is needed", request.batch_ids().size())
        .of("batch_ids")
        .beyond(request.batch_ids().size(), 1);
  }
  return trainer_.release(cell, request.batch_ids().front()).map([&] { return reply; });
}

bool happens_once(const wire::ManageModelsRequest&) { return true; }
bool happens_once(const wire::ReleaseBatchesRequest&) { return true; }

}  // namespace trammel
