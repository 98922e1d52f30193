#include <nlohmann/json.hpp>

#include "idl/limits.h"
#include "idl/manage_text.h"
#include "server/base/check.h"
#include "server/base/json_guard.h"
#include "server/compensate/model_file.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {
namespace {

/// Room for everything but the text in the largest sample.
constexpr std::size_t kMaxText = wire::kMaxTextSample - 65536;

std::string as_json(const std::vector<StoredBatch>& batches) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const StoredBatch& batch : batches) {
    list.push_back({{"cell", batch.cell}, {"batch", batch.id}, {"poses", batch.poses}, {"reason", batch.quarantine}});
  }
  return list.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

const char* text(JobStage stage) {
  switch (stage) {
    case JobStage::kQueued:
      return "queued";
    case JobStage::kTraining:
      return "training";
    case JobStage::kStoring:
      return "storing";
    case JobStage::kDone:
      return "done";
    case JobStage::kFailed:
      return "failed";
  }
  return "failed";
}

nlohmann::ordered_json as_json(const std::optional<std::int64_t>& unix_s) {
  return unix_s ? nlohmann::ordered_json(*unix_s) : nlohmann::ordered_json(nullptr);
}

std::string as_json(const std::vector<Trainer::DatedJob>& jobs) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const auto& [asked, progress] : jobs) {
    list.push_back({{"job", progress.job},
                    {"cell", progress.cell},
                    {"kind", asked.kind == JobKind::kDiagnose ? "diagnose" : "train"},
                    {"stage", text(progress.stage)},
                    {"what", progress.what},
                    {"share", progress.share},
                    {"batches", asked.batch_ids},
                    {"model_version", progress.model_version},
                    {"in_force", progress.in_force},
                    {"created_unix_s", asked.created_at},
                    {"started_unix_s", as_json(asked.started_at)},
                    {"finished_unix_s", as_json(asked.finished_at)}});
  }
  return nlohmann::ordered_json({{"jobs", std::move(list)}})
      .dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

/// What MANAGE_RELEASE_AND_TRAIN asks for.
struct ReleasedTraining {
  std::vector<std::string> batches;
  std::string level, bias;
};

Result<ReleasedTraining> released_training(const std::string& text) {
  static const std::string kWhat = "what to release and to train from";
  constexpr JsonLimits kLimits{.bytes = std::size_t{1} << 20, .depth = 4, .values = 10'000};
  if (const Status small = check_json_limits(text, kWhat, kLimits); !small) return tl::make_unexpected(small.error());
  try {
    const auto json = nlohmann::json::parse(text);
    return ReleasedTraining{json.at("batches").get<std::vector<std::string>>(), json.value("level", ""),
                            json.value("bias", "")};
  } catch (const nlohmann::json::exception& error) {
    return refused("what to release and to train from is not said: {}", error.what());
  }
}

/// A reply with the version, or the error.
Result<wire::ManageModelsReply> with_version(const Result<int>& version) {
  if (!version) return tl::make_unexpected(version.error());
  wire::ManageModelsReply reply;
  reply.version(*version);
  return reply;
}

}  // namespace

Result<wire::ManageModelsReply> Handlers::answer(const wire::ManageModelsRequest& request) {
  if (request.action() == wire::MANAGE_JOB) return job_of(request.job());
  const std::string& cell = request.about().cell();
  if (cell.empty() && request.action() == wire::MANAGE_QUARANTINE) return quarantine_of("");
  if (cell.empty() && request.action() == wire::MANAGE_JOBS) return jobs_of("");
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  return answer_of_cell(cell, request);
}

Result<wire::ManageModelsReply> Handlers::answer_of_cell(const std::string& cell,
                                                         const wire::ManageModelsRequest& request) {
  switch (request.action()) {
    case wire::MANAGE_LIST:
      return models_of(cell);
    case wire::MANAGE_ACTIVATE:
      return with_version(trainer_.activate(cell, request.version()).map([&] { return request.version(); }));
    case wire::MANAGE_ROLLBACK:
      return with_version(trainer_.rollback(cell));
    case wire::MANAGE_EXPORT:
      return exported(cell, request.version());
    case wire::MANAGE_IMPORT:
      return with_version(trainer_.import_model(cell, wire::imported_model(request)));
    case wire::MANAGE_QUARANTINE:
      return quarantine_of(cell);
    case wire::MANAGE_RELEASE:
      return trainer_.release(cell, wire::released_batch(request)).map([] { return wire::ManageModelsReply(); });
    case wire::MANAGE_RELEASE_AND_TRAIN:
      return release_and_train(cell, wire::released_training(request));
    case wire::MANAGE_JOBS:
      return jobs_of(cell);
    case wire::MANAGE_JOB:
      break;  // answered above: a job number needs no cell
  }
  TRAMMEL_CHECK(false);
}

Result<wire::ManageModelsReply> Handlers::job_of(std::int64_t job) const {
  const auto progress = trainer_.progress(job);
  if (!progress) return tl::make_unexpected(progress.error());
  wire::ManageModelsReply reply;
  reply.job(to_wire(*progress));
  return reply;
}

Result<wire::ManageModelsReply> Handlers::models_of(const std::string& cell) const {
  const auto models = store_.models(cell);
  if (!models) return tl::make_unexpected(models.error());
  wire::ManageModelsReply reply;
  const std::int64_t now = unix_now_s();
  const std::size_t skipped = models->size() > wire::MAX_VERSIONS ? models->size() - wire::MAX_VERSIONS : 0;
  for (std::size_t i = skipped; i < models->size(); ++i) reply.models().push_back(to_wire((*models)[i], now));
  return reply;
}

Result<wire::ManageModelsReply> Handlers::exported(const std::string& cell, int asked) const {
  const auto in_force = registry_.in_force(cell);
  if (asked == 0 && !in_force) return failure(ErrorCode::kNotFound, "cell {} has no model in force", cell);
  const int version = asked == 0 ? in_force->version : asked;
  const auto model = in_force && version == in_force->version ? Result<CompensatedModel>(in_force->model)
                                                              : store_.model(cell, version);
  if (!model) return tl::make_unexpected(model.error());
  wire::ManageModelsReply reply;
  reply.version(version);
  reply.text(serialize(*model));
  if (reply.text().size() <= kMaxText) return reply;
  return failure(ErrorCode::kTooLarge, "cell {} version {} has {} bytes, limit {}", cell, version, reply.text().size(),
                 kMaxText)
      .beyond(reply.text().size(), kMaxText);
}

Result<wire::ManageModelsReply> Handlers::jobs_of(const std::string& cell) const {
  const auto jobs = trainer_.jobs(cell);
  if (!jobs) return tl::make_unexpected(jobs.error());
  wire::ManageModelsReply reply;
  reply.text(as_json(*jobs));
  return reply;
}

Result<wire::ManageModelsReply> Handlers::release_and_train(const std::string& cell, const std::string& text) {
  const auto wanted = released_training(text);
  if (!wanted) return tl::make_unexpected(wanted.error());
  if (wanted->batches.size() > wire::MAX_BATCHES) {
    return failure(ErrorCode::kTooLarge, "{} batches in one request, limit {}", wanted->batches.size(),
                   wire::MAX_BATCHES)
        .of("batches")
        .beyond(wanted->batches.size(), wire::MAX_BATCHES);
  }
  const auto job = trainer_.retrain(cell, wanted->batches, wanted->level, wanted->bias, Trainer::Quarantine::kReleased);
  if (!job) return tl::make_unexpected(job.error());
  return job_of(*job);
}

Result<wire::ManageModelsReply> Handlers::quarantine_of(const std::string& cell) const {
  const auto batches = trainer_.quarantined(cell);
  if (!batches) return tl::make_unexpected(batches.error());
  wire::ManageModelsReply reply;
  reply.text(as_json(*batches));
  return reply;
}

bool happens_once(const wire::ManageModelsRequest& request) {
  return request.action() == wire::MANAGE_ACTIVATE || request.action() == wire::MANAGE_ROLLBACK ||
         request.action() == wire::MANAGE_IMPORT || request.action() == wire::MANAGE_RELEASE ||
         request.action() == wire::MANAGE_RELEASE_AND_TRAIN;
}

}  // namespace trammel
