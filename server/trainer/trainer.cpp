#include "server/trainer/trainer.h"

#include <pthread.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <exception>
#include <set>
#include <utility>

#include "server/base/check.h"
#include "server/base/hash.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/error_sources/spelling.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/measurement.h"
#include "server/measurement/velocity.h"
#include "server/trainer/pipeline/extend.h"

namespace trammel {
namespace {

constexpr int kMaxAttempts = 3;                           // of one job that takes the process down
constexpr std::size_t kMaxBatchId = 128;                  // bytes
constexpr int kJobsListed = 20;                           // of those done and of those failed, the last ones
constexpr std::chrono::milliseconds kReportInterval{50};  // of a running training, for its watchers

Status check_batch_id(const std::string& id) {
  if (id.empty()) return refused("a batch needs an id");
  if (id.size() > kMaxBatchId) return refused("batch id of {} bytes, limit {}", id.size(), kMaxBatchId);
  const bool printable = std::all_of(id.begin(), id.end(), [](unsigned char c) { return c >= 0x20 && c != 0x7F; });
  if (!printable) return refused("batch id {:?} has control characters", id);
  return {};
}

/// Whether a model of one serves the other: the kinematics count, names and priors do not.
bool same_robot(const Chain& a, const Chain& b) {
  if (a.size() != b.size() || a.transmission() != b.transmission()) return false;
  for (int i = 0; i < a.size(); ++i) {
    const Joint& one = a.joint(i);
    const Joint& other = b.joint(i);
    const auto numbers = [](const LinkGeometry& l) { return std::array{l.theta, l.d, l.a, l.alpha, l.beta}; };
    if (one.type != other.type || numbers(one.link) != numbers(other.link)) return false;
  }
  return true;
}

/// Whether the tools and payloads that the model was trained with are still what the cell says they are.
bool same_tools(const CompensatedModel& model, const Cell& cell) {
  const auto same_pose = [](const std::optional<Pose>& a, const std::optional<Pose>& b) {
    return a.has_value() == b.has_value() && (!a || a->matrix() == b->matrix());
  };
  const auto same_payload = [](const auto& known, const auto& present, const std::string& name) {
    if (name.empty()) return true;
    const auto now = present.find(name);
    return now != present.end() && now->second.mass == known.at(name).mass &&
           now->second.p_FoCog_F == known.at(name).p_FoCog_F;
  };
  const auto& trained_with = model.parts().trained_with;
  return std::all_of(trained_with.begin(), trained_with.end(), [&](const auto& pair) {
    const auto& [tool, payload] = pair;
    const auto now = cell.tools.find(tool);
    return now != cell.tools.end() && same_pose(now->second, model.cell().tools.at(tool)) &&
           same_payload(model.cell().payloads, cell.payloads, payload);
  });
}

/// Whether the cell can be served with the model; `which` names it.
Status check_fits_cell(const CompensatedModel& model, const Cell& cell, const std::string& which) {
  if (!same_robot(model.cell().robot, cell.robot)) {
    return refused("{} was trained for another robot than cell {} has", which, cell.name);
  }
  if (!same_tools(model, cell)) {
    return refused("{} was trained with other tools or payloads than cell {} has under these names", which, cell.name);
  }
  return {};
}

/// Appends `next` in time. Pose ids stay unique; extra columns, which no training reads, are left behind.
void append(MeasurementBatch& all, MeasurementBatch next) {
  for (Measurement& m : next.measurements) {
    m.pose_id = next.id + "/" + m.pose_id;
    m.context.index = static_cast<int>(all.measurements.size());
    m.extra.clear();
    all.measurements.push_back(std::move(m));
  }
  all.joint_types = next.joint_types;
  all.measured_at = std::max(all.measured_at, next.measured_at);
  all.id += (all.id.empty() ? "" : "+") + next.id;
  all.source_text += next.source_text;
}

/// The cell's own list and what the model in force has besides, as an applied diagnosis or somebody's level put it
/// there: what was won stays won. Empty where there is nothing besides.
std::optional<std::string> level_with_additions(const Cell& cell, const CompensatedModel& in_force) {
  std::vector<std::string> level = cell.model.error_sources;
  const auto listed = [&](const std::string& name) {
    return std::find(level.begin(), level.end(), as_listed(name, level)) != level.end();
  };
  std::vector<std::string> names;
  for (const ErrorSourcePtr& source : in_force.parts().physics.sources) names.push_back(source->name());
  const std::size_t own = level.size();
  for (const std::string& name : lasting_sources(names)) {
    if (!listed(name)) level.push_back(name);
  }
  if (level.size() == own) return std::nullopt;
  return level_of(level);
}

JobStage stage_of(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return JobStage::kQueued;
    case JobState::kRunning:
      return JobStage::kTraining;
    case JobState::kDone:
      return JobStage::kDone;
    case JobState::kFailed:
      return JobStage::kFailed;
  }
  return JobStage::kFailed;
}

JobProgress progress_of(const StoredJob& job) {
  JobProgress progress;
  progress.job = job.id;
  progress.cell = job.cell;
  progress.stage = stage_of(job.state);
  progress.what = job.message;
  progress.share = job.state == JobState::kDone ? 1 : 0;
  progress.model_version = job.model_version;
  return progress;
}

}  // namespace

Result<MeasurementBatch> checked_batch(const StoredBatch& stored, const Cell& cell) {
  auto parsed = parse_batch(stored.csv, "batch " + stored.id);
  if (!parsed) return parsed;
  parsed->id = stored.id;
  return check_against_cell(dated(std::move(*parsed), stored.accepted_at), cell);
}

Status check_released(const StoredBatch& batch) {
  if (batch.quarantine.empty()) return {};
  return refused("batch {} of cell {} is in quarantine: {}; release it if it is good", batch.id, batch.cell,
                 batch.quarantine);
}

Trainer::Trainer(std::map<std::string, std::shared_ptr<const Cell>> cells, Store& store, ModelRegistry& registry,
                 TrainerOptions options)
    : cells_(std::move(cells)),
      store_(store),
      registry_(registry),
      options_(options),
      queue_(std::make_unique<BoundedQueue<std::int64_t>>(static_cast<std::size_t>(options.queue_capacity))) {}

Trainer::~Trainer() { stop(); }

void Trainer::set_listeners(ProgressListener progress, ModelListener model) {
  TRAMMEL_CHECK(!worker_.joinable());
  on_progress_ = std::move(progress);
  on_model_ = std::move(model);
}

Result<std::vector<std::string>> Trainer::take_up() {
  TRAMMEL_CHECK(!worker_.joinable() && !taken_up_);
  std::vector<std::string> notices;
  for (const auto& [name, cell] : cells_) {
    if (auto published = publish_from_store(name); !published) notices.push_back(sentence(published.error()));
  }
  auto unfinished = store_.unfinished_jobs();
  if (!unfinished) return tl::make_unexpected(unfinished.error());
  std::vector<StoredJob> jobs;
  for (StoredJob& job : *unfinished) {
    const auto wanted = can_take_up(job, notices);
    if (!wanted) return tl::make_unexpected(wanted.error());
    job.state = JobState::kQueued;
    if (*wanted) jobs.push_back(std::move(job));
  }
  // Accepted is accepted: those of before may be more than the queue takes now.
  queue_ = std::make_unique<BoundedQueue<std::int64_t>>(
      std::max(static_cast<std::size_t>(options_.queue_capacity), jobs.size()));
  for (const StoredJob& job : jobs) TRAMMEL_CHECK(queue_->try_push(std::int64_t{job.id}));
  taken_up_ = std::move(jobs);
  return notices;
}

Result<bool> Trainer::can_take_up(const StoredJob& job, std::vector<std::string>& notices) {
  if (!cells_.contains(job.cell)) {
    notices.push_back(fmt::format("job {} waits: cell {} is not served here", job.id, job.cell));
    return false;
  }
  if (job.state != JobState::kRunning || job.attempts < kMaxAttempts) return true;
  const std::string why = fmt::format("its training was interrupted by a crash {} times", job.attempts);
  if (auto failed = store_.set_job_failed(job.id, why); !failed) return tl::make_unexpected(failed.error());
  notices.push_back(fmt::format("job {} of cell {} has failed: {}", job.id, job.cell, why));
  return false;
}

Result<std::vector<std::string>> Trainer::start() {
  TRAMMEL_CHECK(!worker_.joinable());
  std::vector<std::string> notices;
  if (!taken_up_) {
    auto taken = take_up();
    if (!taken) return taken;
    notices = std::move(*taken);
  }
  for (const StoredJob& job : *taken_up_) report(progress_of(job));
  taken_up_.reset();
  worker_ = std::jthread([this](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "trainer");
    work(stop);
  });
  return notices;
}

void Trainer::stop() {
  if (!worker_.joinable()) return;
  worker_.request_stop();
  worker_.join();
}

Result<std::int64_t> Trainer::submit(const std::string& cell_name, const std::string& batch_id, const std::string& csv,
                                     const std::string& request_id) {
  const auto cell_found = cell(cell_name);
  if (!cell_found) return tl::make_unexpected(cell_found.error());
  if (auto valid = check_batch_id(batch_id); !valid) return tl::make_unexpected(valid.error());
  auto parsed = parse_batch(csv, "batch " + batch_id);
  if (!parsed) return tl::make_unexpected(parsed.error());
  parsed->id = batch_id;
  const auto checked = check_against_cell(std::move(*parsed), **cell_found);
  if (!checked) return tl::make_unexpected(checked.error());
  const int poses = static_cast<int>(checked->measurements.size());
  if (poses > options_.max_poses) {
    return failure(ErrorCode::kTooLarge, "batch {} has {} poses, limit {}", batch_id, poses, options_.max_poses);
  }

  const std::lock_guard lock(submit_mutex_);
  const bool repeated = store_.batch(cell_name, batch_id).has_value();
  if (!repeated) {
    if (auto room = check_room(); !room) return tl::make_unexpected(room.error());
  }
  StoredJob job;
  job.cell = cell_name;
  job.batch_ids = {batch_id};
  job.created_at = unix_now();
  const auto accepted =
      store_.add_batch({cell_name, batch_id, csv, sha256_hex(csv), request_id, job.created_at, poses}, job);
  if (!accepted) return tl::make_unexpected(accepted.error());
  if (!repeated) enqueue(*accepted);
  return accepted->id;
}

Status Trainer::release(const std::string& cell_name, const std::string& batch_id) {
  if (const auto found = cell(cell_name); !found) return tl::make_unexpected(found.error());
  return store_.set_quarantine(cell_name, batch_id, "");
}

Result<std::vector<StoredBatch>> Trainer::quarantined(const std::string& cell_name) const {
  std::vector<StoredBatch> all;
  for (const auto& [name, known] : cells_) {
    if (!cell_name.empty() && name != cell_name) continue;
    auto batches = store_.batches(name);
    if (!batches) return batches;
    std::copy_if(batches->begin(), batches->end(), std::back_inserter(all),
                 [](const StoredBatch& batch) { return !batch.quarantine.empty(); });
  }
  return all;
}

Result<std::int64_t> Trainer::retrain(const std::string& cell_name, const std::vector<std::string>& batch_ids,
                                      const std::string& level, const std::string& bias, Quarantine quarantine) {
  const auto cell_found = cell(cell_name);
  if (!cell_found) return tl::make_unexpected(cell_found.error());
  if (!level.empty()) {
    const auto specs = parse_level(level);
    if (!specs) return tl::make_unexpected(specs.error());
    for (const std::string& spec : *specs) {
      if (auto source = make_error_source(spec, **cell_found); !source) return tl::make_unexpected(source.error());
    }
  }
  if (!bias.empty()) {
    if (const Status spelled = check_bias_spelling(bias); !spelled) return tl::make_unexpected(spelled.error());
  }
  const bool release = quarantine == Quarantine::kReleased;
  if (release && batch_ids.empty()) return refused("to release a batch takes its id: which one is good");
  const auto stored = store_.batches(cell_name);
  if (!stored) return tl::make_unexpected(stored.error());
  if (stored->empty()) return failure(ErrorCode::kNotFound, "cell {} has no batch to train from", cell_name);

  StoredJob job;
  job.cell = cell_name;
  job.batch_ids = batch_ids.empty() ? std::vector{stored->back().id} : batch_ids;
  job.level = level;
  job.bias = bias;
  job.created_at = unix_now();
  const std::set<std::string> wanted(job.batch_ids.begin(), job.batch_ids.end());
  if (wanted.size() != job.batch_ids.size()) return refused("a batch is named twice; each counts once in a training");
  std::int64_t poses = 0;
  for (const StoredBatch& batch : *stored) {
    if (!wanted.contains(batch.id)) continue;
    if (const Status free = check_released(batch); !free && !release) return tl::make_unexpected(free.error());
    poses += batch.poses;
  }
  if (poses > options_.max_poses) {
    return failure(ErrorCode::kTooLarge, "the batches have {} poses together, limit {}", poses, options_.max_poses);
  }

  const std::lock_guard lock(submit_mutex_);
  if (auto room = check_room(); !room) return tl::make_unexpected(room.error());
  const auto accepted = store_.add_job(job, release);
  if (!accepted) return tl::make_unexpected(accepted.error());
  enqueue(*accepted);
  return accepted->id;
}

Status Trainer::activate(const std::string& cell_name, int version) {
  if (auto found = cell(cell_name); !found) return tl::make_unexpected(found.error());
  const std::lock_guard lock(activation_mutex_);
  auto model = load_for_service(cell_name, version);
  if (!model) return tl::make_unexpected(model.error());
  if (auto activated = store_.activate(cell_name, version); !activated) return activated;
  put_in_force(std::make_shared<const ServedModel>(ServedModel{cell_name, version, std::move(*model)}));
  return {};
}

Result<int> Trainer::rollback(const std::string& cell_name) {
  if (auto found = cell(cell_name); !found) return tl::make_unexpected(found.error());
  const std::lock_guard lock(activation_mutex_);
  const auto versions = store_.previous_in_force(cell_name);
  if (!versions) return tl::make_unexpected(versions.error());
  std::optional<Error> why_not;
  for (std::size_t i = 0; i < versions->size(); ++i) {
    const int version = (*versions)[i];
    auto model = load_for_service(cell_name, version);
    if (!model) {
      if (!why_not) why_not = model.error();
      continue;
    }
    if (auto restored = store_.rollback(cell_name, static_cast<int>(i) + 1); !restored) return restored;
    put_in_force(std::make_shared<const ServedModel>(ServedModel{cell_name, version, std::move(*model)}));
    return version;
  }
  return tl::make_unexpected(*why_not);
}

Result<int> Trainer::import_model(const std::string& cell_name, const std::string& text) {
  const auto cell_found = cell(cell_name);
  if (!cell_found) return tl::make_unexpected(cell_found.error());
  const auto model = deserialize(text, "imported model");
  if (!model) return tl::make_unexpected(model.error());
  if (model->cell().name != cell_name) {
    return refused("imported model {} is of cell {}, not {}", model->provenance().id, model->cell().name, cell_name);
  }
  const Status fits = check_fits_cell(*model, **cell_found, "imported model " + model->provenance().id);
  if (!fits) return tl::make_unexpected(fits.error());
  const std::lock_guard lock(activation_mutex_);
  const auto present = store_.models(cell_name);
  if (!present) return tl::make_unexpected(present.error());
  for (const StoredModel& stored : *present) {
    if (stored.hash == model->provenance().hash) return stored.version;
  }
  const auto version = store_.add_model(cell_name, *model, 0, false, "");
  if (version && on_model_) on_model_({cell_name, *version, *model}, false);
  return version;
}

Result<JobProgress> Trainer::progress(std::int64_t job) const {
  {
    const std::lock_guard lock(progress_mutex_);
    if (const auto found = progress_.find(job); found != progress_.end()) return found->second;
  }
  const auto stored = store_.job(job);
  if (!stored) return tl::make_unexpected(stored.error());
  JobProgress progress = progress_of(*stored);
  const auto present = registry_.in_force(stored->cell);
  progress.in_force = present && stored->model_version != 0 && present->version == stored->model_version;
  return progress;
}

Result<std::vector<Trainer::DatedJob>> Trainer::jobs(const std::string& cell_name) const {
  const auto stored = store_.recent_jobs(cell_name, kJobsListed);
  if (!stored) return tl::make_unexpected(stored.error());
  std::vector<DatedJob> jobs;
  for (const StoredJob& job : *stored) {
    auto now = progress(job.id);
    if (!now) return tl::make_unexpected(now.error());
    jobs.push_back({job, std::move(*now)});
  }
  return jobs;
}

int Trainer::queued_jobs() const { return static_cast<int>(queue_->size()); }

Result<std::shared_ptr<const Cell>> Trainer::cell(const std::string& name) const {
  const auto found = cells_.find(name);
  if (found == cells_.end()) return failure(ErrorCode::kNotFound, "cell {} is not served here", name);
  return found->second;
}

Status Trainer::check_room() const {
  if (queue_->size() < static_cast<std::size_t>(options_.queue_capacity)) return {};
  return failure(ErrorCode::kBusy, "{} trainings are waiting, limit {}; try again later", queue_->size(),
                 options_.queue_capacity);
}

void Trainer::enqueue(const StoredJob& job) {
  report(progress_of(job));  // before the push: the worker's reports come after it
  TRAMMEL_CHECK(queue_->try_push(std::int64_t{job.id}));
}

Status Trainer::publish_from_store(const std::string& cell_name) {
  const std::lock_guard lock(activation_mutex_);
  const auto version = store_.version_in_force(cell_name);
  if (!version) return tl::make_unexpected(version.error());
  if (!*version) return {};
  auto model = load_for_service(cell_name, **version);
  if (!model) return tl::make_unexpected(model.error());
  put_in_force(std::make_shared<const ServedModel>(ServedModel{cell_name, **version, std::move(*model)}));
  return {};
}

Result<CompensatedModel> Trainer::load_for_service(const std::string& cell_name, int version) const {
  auto model = store_.model(cell_name, version);
  if (!model) return model;
  const Status fits =
      check_fits_cell(*model, *cells_.at(cell_name), fmt::format("version {} of cell {}", version, cell_name));
  if (!fits) return tl::make_unexpected(fits.error());
  return model;
}

/// Of a model that the store has put in force; activation_mutex_ is held.
void Trainer::put_in_force(std::shared_ptr<const ServedModel> model) {
  registry_.publish(model);
  if (on_model_) on_model_(*model, true);
}

void Trainer::work(const std::stop_token& stop) {
  while (const auto job = queue_->pop(stop)) run(*job, stop);
}

void Trainer::run(std::int64_t job, const std::stop_token& stop) {
  const Status outcome = [&]() -> Status {
    try {
      return attempt(job, stop);
    } catch (const std::exception& error) {  // out of memory, for one: this training ends, the service goes on
      return failure(ErrorCode::kInternal, "the training broke off: {}", error.what());
    }
  }();
  if (outcome) return;
  JobProgress progress;
  progress.job = job;
  if (const auto stored = store_.job(job)) progress = progress_of(*stored);
  if (stop.stop_requested()) {
    // Should the store refuse, the job counts as interrupted and is taken up all the same.
    static_cast<void>(store_.set_job_queued(job));
    progress.stage = JobStage::kQueued;
    return report(progress);
  }
  const Status failed = store_.set_job_failed(job, sentence(outcome.error()));
  if (!failed && failed.error().code == ErrorCode::kNotFound) return;  // its model is stored: it has not failed
  progress.stage = JobStage::kFailed;
  progress.what = sentence(outcome.error());
  report(progress);
}

Status Trainer::attempt(std::int64_t id, const std::stop_token& stop) {
  const auto job = store_.job(id);
  if (!job) return tl::make_unexpected(job.error());
  const auto cell_found = cell(job->cell);
  if (!cell_found) return tl::make_unexpected(cell_found.error());
  if (auto running = store_.set_job_running(id); !running) return running;

  JobProgress progress = progress_of(*job);
  progress.stage = JobStage::kTraining;
  report(progress);
  if (job->kind == JobKind::kDiagnose) return attempt_diagnosis(*job, *cell_found, std::move(progress), stop);
  const auto looked_at = hold_against_model_in_force(*job, **cell_found);
  if (!looked_at) return tl::make_unexpected(looked_at.error());
  const auto batch = load_batches(*job, **cell_found);
  if (!batch) return tl::make_unexpected(batch.error());

  std::string note = looked_at->empty() ? "" : "the batch: " + *looked_at;
  const auto model = trained(*job, *batch, train_options(*job, **cell_found, progress, stop), note);
  if (!model) return tl::make_unexpected(model.error());
  return keep(*model, std::move(progress), Bar::kBetter, note);
}

std::function<bool(const std::string&, double)> Trainer::reporter(const JobProgress& progress,
                                                                  const std::stop_token& stop) {
  auto reported = std::make_shared<std::chrono::steady_clock::time_point>();
  return [this, running = progress, reported, stop](const std::string& stage, double share) mutable {
    const auto time = std::chrono::steady_clock::now();
    if (time >= *reported + kReportInterval) {
      *reported = time;
      running.what = stage;
      running.share = share;
      report(running);
    }
    return !stop.stop_requested();
  };
}

TrainOptions Trainer::train_options(const StoredJob& job, const Cell& cell, const JobProgress& progress,
                                    const std::stop_token& stop) {
  TrainOptions options;
  if (!job.level.empty()) {
    options.level = job.level;
  } else if (const auto served = registry_.in_force(job.cell)) {
    options.level = level_with_additions(cell, served->model);
  }
  if (!job.bias.empty()) options.bias = job.bias;
  options.validation_share = options_.validation_share;
  options.seed = options_.seed;
  options.trained_at = unix_now();
  options.progress = reporter(progress, stop);
  return options;
}
Result<MeasurementBatch> Trainer::load_batches(const StoredJob& job, const Cell& cell) const {
  const auto may_release = store_.may_release(job.id);
  if (!may_release) return tl::make_unexpected(may_release.error());
  const auto sessions = judging_sessions(job);
  if (!sessions) return tl::make_unexpected(sessions.error());
  std::vector<MeasurementBatch> batches;
  for (const std::string& id : job.batch_ids) {
    const auto stored = store_.batch(job.cell, id);
    if (!stored) return tl::make_unexpected(stored.error());
    if (const Status free = check_released(*stored); !free && !*may_release) return tl::make_unexpected(free.error());
    auto checked = checked_batch(*stored, cell);
    if (!checked) return checked;
    // The drawing of the rows held out is a property of the batch: see the class.
    checked = held_out_by_service(std::move(*checked), options_.validation_share, options_.seed);
    batches.push_back(without_older_judges(std::move(*checked), *sessions));
  }
  if (batches.size() == 1) return std::move(batches.front());
  MeasurementBatch all;
  for (MeasurementBatch& batch : batches) append(all, std::move(batch));
  return all;
}

void Trainer::report(const JobProgress& progress) {
  {
    const std::lock_guard lock(progress_mutex_);
    const bool finished = progress.stage == JobStage::kDone || progress.stage == JobStage::kFailed;
    if (finished) {
      progress_.erase(progress.job);
    } else {
      progress_[progress.job] = progress;
    }
  }
  if (on_progress_) on_progress_(progress);
}

}  // namespace trammel
