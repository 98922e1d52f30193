#include <algorithm>
#include <map>
#include <string>

#include "idl/limits.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"
#include "server/report/cell_health.h"
#include "server/report/fleet_json.h"
#include "server/report/work_json.h"
#include "server/store/audit_json.h"
#include "server/store/servers_json.h"

namespace trammel {
namespace {

using wire::ReadModelsReply;
using wire::ReadModelsRequest;

/// The last ones of a list that is longer than an answer takes.
template <typename Item>
std::size_t first_of_last(const std::vector<Item>& all, std::size_t most) {
  return all.size() > most ? all.size() - most : 0;
}

Result<ReadModelsReply> list_of(const Result<std::vector<StoredBatch>>& batches) {
  if (!batches) return tl::make_unexpected(batches.error());
  ReadModelsReply reply;
  for (std::size_t i = first_of_last(*batches, wire::MAX_VERSIONS); i < batches->size(); ++i)
    reply.batches().push_back(to_wire((*batches)[i]));
  return reply;
}

/// The store's record of a cell's checks, and of the verdict on its model in force.
Result<CellHealth> health_in(const Store& store, const ModelRegistry& registry,
                             const std::string& cell, std::int64_t since, std::size_t most) {
  const auto checks = TRY(store.health_checks(cell, std::max<std::int64_t>(since, 0), most));
  const auto record = TRY(store.in_force_record(cell));
  CellHealth health{cell};
  for (const StoredCheck& one : checks)
    health.checks.push_back({one.job, one.at, one.batch_ids, one.findings});
  const auto model = registry.in_force(cell);
  if (!model) return health;
  ServedOnRecord& served = health.served.emplace();
  served.version = model->version;
  served.model = model->model.provenance().id;
  served.between_sessions = session_changes(model->model);
  if (!record || record->version != model->version) return health;  // served from a copy
  served.since = record->since;
  served.version_before = record->before;
  const JobOutcome judged = record->judged.value_or(JobOutcome());
  served.before = judged.before;
  served.after = judged.after;
  served.limit = judged.limit;
  served.why = (record->judged_when_made ? "when it was made: " : "") + judged.why;
  return health;
}

/// The servers of the record; null while they are unknown.
nlohmann::ordered_json servers_of(const Trainer& trainer) {
  const auto servers = trainer.servers();
  return servers ? servers_json(*servers) : nlohmann::ordered_json(nullptr);
}

Status check_fits(const std::string& what, std::size_t bytes) {
  if (bytes <= wire::kMaxText) return {};
  return failure(ErrorCode::kTooLarge, "{} has {} bytes, limit {}", what, bytes, wire::kMaxText)
      .beyond(bytes, wire::kMaxText);
}

}  // namespace

Result<ReadModelsReply> Handlers::answer(const ReadModelsRequest& request) {
  const std::string& cell = request.about().cell();
  const bool of_all = request.what() == wire::READ_JOBS ||
                      request.what() == wire::READ_QUARANTINE ||
                      request.what() == wire::READ_BATCHES || request.what() == wire::READ_AUDIT ||
                      request.what() == wire::READ_HEALTH;
  if (request.what() == wire::READ_JOB) return job_of(request.job());
  if (request.what() == wire::READ_FLEET) return fleet();
  if (request.what() > wire::READ_REPLAY) return unsupported<ReadModelsReply>("what");
  if (!cell.empty() || !of_all) {
    TRY(subjects_.cell(request.about()));
  }
  auto reply = read(cell, request);
  if (!reply) return reply;
  if (const auto served = registry_.in_force(cell))
    reply->in_force(to_wire(*served, true, unix_now_s()));
  return reply;
}

Result<ReadModelsReply> Handlers::read(const std::string& cell,
                                       const ReadModelsRequest& request) const {
  switch (request.what()) {
    case wire::READ_MODELS:
      return models_of(cell);
    case wire::READ_MODEL:
      return exported(cell, request.version());
    case wire::READ_JOBS:
      return jobs_of(cell);
    case wire::READ_QUARANTINE:
      return list_of(trainer_.quarantined(cell));
    case wire::READ_BATCHES:
      return list_of(trainer_.batches(cell));
    case wire::READ_BATCH:
      return batch_of(cell, request.batch_id());
    case wire::READ_FINDINGS:
      return findings_of(cell, request.job(), request.page());
    case wire::READ_AUDIT:
      return audit_of(cell, request.since_unix_s(), request.most());
    case wire::READ_HEALTH:
      return health_of(cell, request.since_unix_s(), request.most());
    case wire::READ_REPLAY:
      return replayed(cell, request.version());
    default:
      return unsupported<ReadModelsReply>("what");
  }
}

Result<ReadModelsReply> Handlers::job_of(std::int64_t job) const {
  const auto progress = TRY(trainer_.progress(job));
  const auto asked = TRY(store_.job(job));
  ReadModelsReply reply;
  reply.jobs().push_back(to_wire(Trainer::DatedJob{asked, progress}));
  return reply;
}

Result<ReadModelsReply> Handlers::models_of(const std::string& cell) const {
  const auto models = TRY(store_.models(cell));
  const auto batches = TRY(store_.batches(cell));
  std::map<std::string, std::string>
      hashes;  // by batch; of several batches together none is stored
  for (const StoredBatch& batch : batches) hashes[batch.id] = batch.hash;
  ReadModelsReply reply;
  const auto served = registry_.in_force(cell);
  const std::int64_t now = unix_now_s();
  for (std::size_t i = first_of_last(models, wire::MAX_VERSIONS); i < models.size(); ++i) {
    reply.models().push_back(to_wire(models[i], now));
    const auto hash = hashes.find(models[i].batch_id);
    if (hash != hashes.end()) reply.models().back().batch_hash(hash->second);
    if (served && served->version == models[i].version) {
      reply.models().back().notes(to_wire(served->notes));
      reply.models().back().budget(budget_to_wire(*served));
    }
  }
  return reply;
}

Result<ReadModelsReply> Handlers::exported(const std::string& cell, int asked) const {
  const auto in_force = registry_.in_force(cell);
  if (asked == 0 && !in_force)
    return failure(ErrorCode::kNotFound, "cell {} has no model in force", cell).of("cell");
  const int version = asked == 0 ? in_force->version : asked;
  const auto model =
      TRY(in_force && version == in_force->version ? Result<CompensatedModel>(in_force->model)
                                                   : store_.model(cell, version));
  ReadModelsReply reply;
  reply.version(version);
  reply.text(serialize(model));
  TRY(check_fits(fmt::format("cell {} version {}", cell, version), reply.text().size()));
  return reply;
}

Result<ReadModelsReply> Handlers::replayed(const std::string& cell, int version) const {
  const auto in_force = registry_.in_force(cell);
  if (!in_force)
    return failure(ErrorCode::kNotFound, "cell {} has no model in force", cell).of("cell");
  const auto other =
      TRY(version == 0 || version == in_force->version ? Result<CompensatedModel>(in_force->model)
                                                       : store_.model(cell, version));
  const WorkVersions versions{cell, in_force->version, version};
  const WorkAsked work = work_asked(in_force->model, version == 0 ? nullptr : &other,
                                    trainer_.recent_poses().of(cell));
  ReadModelsReply reply;
  reply.version(in_force->version);
  reply.text(work_json(work, versions, in_force->model.cell().robot).dump());
  return reply;
}

Result<ReadModelsReply> Handlers::jobs_of(const std::string& cell) const {
  const auto jobs = TRY(trainer_.jobs(cell));
  ReadModelsReply reply;
  for (std::size_t i = first_of_last(jobs, wire::MAX_JOBS); i < jobs.size(); ++i)
    reply.jobs().push_back(to_wire(jobs[i]));
  return reply;
}

Result<ReadModelsReply> Handlers::batch_of(const std::string& cell, const std::string& id) const {
  auto batch = TRY(store_.batch(cell, id));
  ReadModelsReply reply;
  TRY(check_fits("batch " + id, batch.csv.size()));
  reply.batches().push_back(to_wire(batch));
  reply.text(std::move(batch.csv));
  return reply;
}

Result<ReadModelsReply> Handlers::audit_of(const std::string& cell, std::int64_t since,
                                           std::size_t most) const {
  const auto trail = TRY(store_.audit({cell, std::max<std::int64_t>(since, 0), most}));
  ReadModelsReply reply;
  reply.text(
      audit_json(trail).dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  if (const Status fits = check_fits("the audit trail", reply.text().size()); !fits)
    return Failure(fits.error()).next("ask for fewer rows");
  return reply;
}

Result<ReadModelsReply> Handlers::findings_of(const std::string& cell, std::int64_t job,
                                              bool page) const {
  const auto asked = TRY(trainer_.progress(job));
  if (asked.cell != cell)
    return failure(ErrorCode::kNotFound, "job {} is not of cell {}", job, cell)
        .of("job")
        .with_value(job);
  auto found = TRY(trainer_.diagnosis(job));
  ReadModelsReply reply;
  if (page) reply.page_html(std::move(found.page));
  const std::size_t bytes = found.findings.size() + reply.page_html().size();
  if (const Status fits = check_fits(fmt::format("what job {} found", job), bytes); !fits)
    return Failure(fits.error()).next("ask without the page");
  reply.text(std::move(found.findings));
  return reply;
}

Result<ReadModelsReply> Handlers::fleet() const {
  std::map<std::string, std::string> checks;  // the last of each cell
  const auto jobs = TRY(trainer_.jobs(""));
  for (const Trainer::DatedJob& job : jobs) {
    if (job.asked.kind() != JobKind::kCheck || job.progress.stage != JobStage::kDone) continue;
    if (const auto found = trainer_.diagnosis(job.asked.id))
      checks[job.asked.cell] = found->findings;
  }
  std::vector<FleetEntry> cells;
  for (const auto& [name, cell] : trainer_.cells()) {
    FleetEntry entry{name, 0, std::nullopt, checks[name]};
    if (const auto served = registry_.in_force(name)) {
      entry.version = served->version;
      entry.model = served->model;
    }
    cells.push_back(std::move(entry));
  }
  ReadModelsReply reply;
  reply.text(fleet_json(cells, unix_now())
                 .dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  TRY(check_fits("the fleet", reply.text().size()));
  return reply;
}

Result<ReadModelsReply> Handlers::health_of(const std::string& cell, std::int64_t since,
                                            std::size_t most) const {
  nlohmann::ordered_json cells = nlohmann::ordered_json::array();
  for (const auto& [name, known] : trainer_.cells()) {
    if (!cell.empty() && name != cell) continue;
    const auto health = health_in(store_, registry_, name, since, most);
    // Who asks for all hears of a record that is away, and who is there.
    if (!health && cell.empty() && health.error().code == ErrorCode::kBusy) continue;
    if (!health) return tl::make_unexpected(health.error());
    cells.push_back(cell_health_json(*health));
  }
  ReadModelsReply reply;
  const nlohmann::ordered_json answer = {
      {"server", store_.server()},
      {"trains", trainer_.trains()},
      {"record", record_json(store_.record())},
      {"servers", cell.empty() ? servers_of(trainer_) : nlohmann::ordered_json(nullptr)},
      {"cells", std::move(cells)}};
  reply.text(answer.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  if (const Status fits = check_fits("the health of cells", reply.text().size()); !fits)
    return Failure(fits.error()).next("ask for fewer checks");
  return reply;
}

bool happens_once(const ReadModelsRequest&) { return false; }

}  // namespace trammel
