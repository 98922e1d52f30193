#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {

Result<wire::ManageModelsReply> Handlers::answer(const wire::ManageModelsRequest& request) {
  if (request.force() && request.action() != wire::MANAGE_ACTIVATE)
    return unsupported<wire::ManageModelsReply>("force");
  if (request.action() == wire::MANAGE_BACKUP)
    return unsupported<wire::ManageModelsReply>("action");
  const std::string& cell = request.about().cell();
  TRY(subjects_.cell(request.about()));
  const auto version = TRY(changed(cell, request));
  wire::ManageModelsReply reply;
  reply.version(version);
  if (const auto served = registry_.in_force(cell))
    reply.model(to_wire(*served, true, unix_now_s()));
  return reply;
}

Result<int> Handlers::changed(const std::string& cell, const wire::ManageModelsRequest& request) {
  const auto expected = TRY(expected_version(request.change()));
  const auto under = [&](const std::string& asked) {
    ChangeId id{request.change().id().to_string(), asked, who(request.header())};
    id.reason = request.reason();
    id.expected_version = expected;
    return id;
  };
  switch (request.action()) {
    case wire::MANAGE_ROLLBACK:
      return trainer_.rollback(cell, under("roll back " + cell));
    case wire::MANAGE_IMPORT: {
      const std::string& text = request.model_text();
      return trainer_.import_model(cell, text, under(in_few_words("import", cell, {text})));
    }
    case wire::MANAGE_CANCEL_JOB:
      return cancel(cell, request.job(),
                    under(fmt::format("cancel job {} of {}", request.job(), cell)))
          .map([] { return 0; });
    default:
      return trainer_
          .activate(cell, request.version(),
                    under(fmt::format("activate {}@{}", cell, request.version())), request.force())
          .map([&] { return int{request.version()}; });
  }
}

Status Handlers::cancel(const std::string& cell, std::int64_t job, const ChangeId& by) {
  const auto asked = TRY(trainer_.progress(job));
  if (asked.cell != cell)
    return failure(ErrorCode::kNotFound, "job {} is not of cell {}", job, cell)
        .of("job")
        .with_value(job);
  return trainer_.cancel(job, by);
}

Result<wire::ReleaseBatchesReply> Handlers::answer(const wire::ReleaseBatchesRequest& request) {
  const std::string& cell = request.about().cell();
  TRY(subjects_.cell(request.about()));
  const auto job = TRY(released(cell, request));
  wire::ReleaseBatchesReply reply;
  reply.job(job);
  return reply;
}

Result<std::int64_t> Handlers::released(const std::string& cell,
                                        const wire::ReleaseBatchesRequest& request) {
  const auto expected = TRY(expected_version(request.change()));
  const auto& batches = request.batch_ids();
  const bool trains = request.action() == wire::RELEASE_AND_TRAIN;
  const bool discards = request.action() == wire::RELEASE_DISCARD;
  if (!trains && batches.size() != 1) {
    return failure(ErrorCode::kUsage, "{} batches to release or to discard, 1 is needed",
                   batches.size())
        .of("batch_ids")
        .beyond(batches.size(), 1);
  }
  ChangeId id{
      request.change().id().to_string(),
      in_few_words(trains     ? "release and train"
                   : discards ? "discard"
                              : "release",
                   cell,
                   {fmt::format("{}", fmt::join(batches, "\n")), request.level(), request.bias()}),
      who(request.header())};
  id.reason = request.reason();
  id.expected_version = expected;
  if (discards)
    return trainer_.discard(cell, batches.front(), id).map([] { return std::int64_t{0}; });
  if (!trains)
    return trainer_.release(cell, batches.front(), id).map([] { return std::int64_t{0}; });
  return trainer_.retrain(cell, batches, request.level(), request.bias(),
                          Trainer::Quarantine::kReleased, id);
}

bool happens_once(const wire::ManageModelsRequest&) { return true; }
bool happens_once(const wire::ReleaseBatchesRequest&) { return true; }

}  // namespace trammel
