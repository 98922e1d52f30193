#include "server/trainer/trainer.h"

#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/base/check.h"
#include "server/base/unix_time.h"

namespace trammel {
namespace {

constexpr int kJobsListed = 20;  // the last finished and the last failed jobs
constexpr std::chrono::seconds kLoadingAtStart{
    1};  // time for models, before the service reports that it is ready
constexpr std::chrono::seconds kKeeperTick{1};
constexpr int kKeeperNiceness = 5;  // answering comes before loading

}  // namespace

Trainer::Trainer(const ServedCells& cells, Store& store, ModelRegistry& registry,
                 TrainerOptions options)
    : cells_(cells),
      store_(store),
      registry_(registry),
      options_(options),
      queue_capacity_(options.queue_capacity),
      keep_(options.keep),
      history_(cells_, store, registry),
      runner_(cells_, store, registry, history_, book_, options),
      began_at_(unix_now()) {}

Trainer::~Trainer() { stop(); }

void Trainer::set_listeners(ProgressListener progress, ModelListener model,
                            TroubleListener trouble) {
  TRAMMEL_CHECK(!worker_.joinable());
  book_.set_listener(std::move(progress));
  history_.set_listener(std::move(model));
  trouble_listener_ = std::move(trouble);
}

Result<std::vector<std::string>> Trainer::take_up() {
  TRAMMEL_CHECK(!worker_.joinable() && !taken_up_);
  std::vector<std::string> notices = history_.announce_all();
  if (store_.is_shared()) {
    presence_.describe(cells());
    is_present_ =
        store_.tell_presence(self()).has_value();  // announced to the others before it compares
    if (const auto now = store_.counts()) agree(now->descriptions);
  }
  const auto until = std::chrono::steady_clock::now() + kLoadingAtStart;
  const ServedCells& served = cells();
  for (auto cell = served.begin(); cell != served.end() && std::chrono::steady_clock::now() < until;
       ++cell)
    static_cast<void>(registry_.in_force(cell->first));  // a failure appears among the troubles
  for (const std::string& trouble : troubles()) notices.push_back(trouble);
  queue_.hold(!options_.trains);
  auto unfinished = store_.unfinished_jobs();
  // The models are served nevertheless.
  if (!unfinished) notices.push_back("the jobs cannot be read: " + sentence(unfinished.error()));
  std::vector<StoredJob> jobs;
  for (StoredJob& job : unfinished.value_or(std::vector<StoredJob>())) {
    if (book_.find(job.id)) continue;  // accepted before the start, it waits already
    const auto wanted = can_take_up(job, notices);
    if (!wanted) {
      notices.push_back(sentence(wanted.error()));
      continue;
    }
    if (!*wanted) continue;
    queue_.push({job.id, job.cell, was_asked_for(job).value_or(true)});
    job.state = JobState::kQueued;
    jobs.push_back(std::move(job));
  }
  taken_up_ = std::move(jobs);
  return notices;
}

Result<bool> Trainer::can_take_up(const StoredJob& job, std::vector<std::string>& notices) {
  if (!cells().contains(job.cell)) {
    notices.push_back(fmt::format("job {} waits: cell {} is not served here", job.id, job.cell));
    return false;
  }
  if (!cells_.find(job.cell)) return false;  // the cell is set apart, which is reported already
  if (job.state != JobState::kRunning || job.attempts < kMaxAttempts) return true;
  if (store_.is_shared() && !store_.set_job_running(job.id))
    return false;  // another server works on it
  const std::string why =
      fmt::format("its training was interrupted by a crash {} times", job.attempts);
  const JobOutcome outcome =
      failed_outcome(failure(ErrorCode::kInternal, "{}", why).value(), JobVerdict::kBroken);
  TRY(store_.set_job_failed(job.id, why, outcome));
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
  for (const StoredJob& job : *taken_up_) book_.report(progress_of(job));
  taken_up_.reset();
  worker_ = std::jthread([this](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "trainer");
    while (const auto taken = queue_.take(stop)) {
      const JobRunner::End end = runner_.run(taken->job.id, {stop, taken->cancelled},
                                             [this] { return queue_.cancelled_by(); });
      if (end == JobRunner::End::kAgain) queue_.push(taken->job);
      if (end == JobRunner::End::kOver) prune(taken->job.cell, stop);
      // Another server works for the cell. After its job, the other waiting jobs of the cell
      // follow.
      if (end == JobRunner::End::kElsewhere) queue_.remove_cell(taken->job.cell);
      queue_.put_down();
      // Its end was requested while its attempt ended: it waits again, and this request must be
      // passed on.
      if (end == JobRunner::End::kAgain && taken->cancelled.stop_requested())
        static_cast<void>(cancel(taken->job.id, {"", "", queue_.cancelled_by()}));
    }
  });
  if (store_.is_shared()) {
    // Cells and jobs that were taken up before are looked at once more: they may have changed
    // meanwhile.
    follower_ = std::jthread([this](const std::stop_token& stop) { follow(0, stop); });
    heartbeat_ = std::jthread([this](const std::stop_token& stop) { beat(stop); });
  }
  keeper_ =
      std::jthread([this, told = troubles()](const std::stop_token& stop) { keep_up(told, stop); });
  reclaimer_ = std::jthread([this](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "reclaimer");
    registry_.free_models(stop);
  });
  return notices;
}

void Trainer::set_limits(int queue_capacity, const KeepRule& keep) {
  queue_capacity_ = queue_capacity;
  const MutexLock lock(keep_mutex_);
  keep_ = keep;
}

void Trainer::prune(const std::string& cell, const std::stop_token& stop) {
  KeepRule keep;
  {
    const MutexLock lock(keep_mutex_);
    keep = keep_;
  }
  // Texts that the store refuses to prune now are pruned after the next job.
  while (!stop.stop_requested() && store_.prune_one(cell, keep).value_or(false)) {
  }
}

void Trainer::keep_up(std::vector<std::string> told, const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "keeper");
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()),
                kKeeperNiceness);  // this thread alone
  while (!stop.stop_requested()) {
    registry_.load_for(stop, kKeeperTick);
    const bool was_readable = store_.state().readable;
    static_cast<void>(store_.try_again());  // the store's state has the result
    if (!was_readable && store_.state().readable) take_up_late();
    tell_troubles(told);
  }
  registry_.stop_loading();
}

std::vector<std::string> Trainer::add_cells(const ServedCells& more) {
  const MutexLock lock(submit_mutex_);
  const ServedCells& before = cells();
  // Read before the cells are served: none of these jobs can end meanwhile.
  std::vector<StoredJob> jobs = store_.unfinished_jobs().value_or(std::vector<StoredJob>());
  std::erase_if(jobs, [&](const StoredJob& job) {
    return before.contains(job.cell) || !more.contains(job.cell);
  });
  cells_.add(more);
  if (store_.is_shared()) {
    presence_.describe(more);
    {
      const MutexLock look_again(agree_mutex_);
      descriptions_ = -1;
    }
    if (const auto now = store_.counts()) agree(now->descriptions);
  }
  std::vector<std::string> notices;
  for (const auto& [name, cell] : more) {
    if (before.contains(name)) continue;
    if (auto announced = history_.announce_from_store(name); !announced)
      notices.push_back(sentence(announced.error()));
  }
  take_up_jobs(std::move(jobs), notices);
  return notices;
}

void Trainer::take_up_late() {
  for (const auto& [name, cell] : cells()) {
    const std::vector<int> versions = store_.versions_to_serve(name);
    if (!versions.empty() && versions.front() != registry_.version_in_force(name))
      registry_.announce(name, versions.front());
  }
  const MutexLock lock(submit_mutex_);
  std::vector<std::string> notices;  // the next start reports them again
  take_up_jobs(store_.unfinished_jobs().value_or(std::vector<StoredJob>()), notices);
}

void Trainer::take_up_jobs(std::vector<StoredJob> jobs, std::vector<std::string>& notices) {
  for (StoredJob& job : jobs) {
    if (book_.find(job.id) || !can_take_up(job, notices).value_or(false)) continue;
    job.state = JobState::kQueued;
    enqueue(job, was_asked_for(job).value_or(true));
  }
}

void Trainer::tell_troubles(std::vector<std::string>& told) {
  std::vector<std::string> now = troubles();
  if (now == told) return;
  const auto missing = [](const std::vector<std::string>& among, const std::string& one) {
    return std::find(among.begin(), among.end(), one) == among.end();
  };
  for (const std::string& trouble : now) {
    if (trouble_listener_ && missing(told, trouble)) trouble_listener_(trouble, false);
  }
  for (const std::string& trouble : told) {
    if (trouble_listener_ && missing(now, trouble)) trouble_listener_(trouble, true);
  }
  told = std::move(now);
}

std::vector<std::string> Trainer::troubles() const {
  std::vector<std::string> all;
  StoreState state = store_.state();
  if (state.why_not_written)
    all.push_back("the store cannot be written: " + sentence(*state.why_not_written));
  if (!state.clock.empty()) all.push_back(state.clock);
  for (std::string& damage : state.damages) all.push_back(std::move(damage));
  for (const auto& [cell, one] : cells_.apart()) all.push_back(one.why);
  for (std::string& trouble : history_.troubles()) {
    if (std::find(all.begin(), all.end(), trouble) == all.end()) all.push_back(std::move(trouble));
  }
  return all;
}

void Trainer::stop() {
  if (!worker_.joinable()) return;
  for (std::jthread* thread : {&worker_, &keeper_, &follower_}) thread->request_stop();
  for (std::jthread* thread : {&worker_, &keeper_, &follower_}) {
    if (thread->joinable()) thread->join();
  }
  if (heartbeat_.joinable()) {
    heartbeat_.request_stop();
    heartbeat_.join();
    static_cast<void>(store_.take_leave());  // a record that is away finds out by the clock
  }
  reclaimer_.request_stop();
  reclaimer_.join();
}

Result<std::vector<StoredBatch>> Trainer::batches(const std::string& cell_name) const {
  std::vector<StoredBatch> all;
  for (const auto& [name, known] : cells()) {
    if (!cell_name.empty() && name != cell_name) continue;
    auto batches = store_.batches(name);
    if (!batches) return batches;
    std::move(batches->begin(), batches->end(), std::back_inserter(all));
  }
  return all;
}

Result<std::vector<StoredBatch>> Trainer::quarantined(const std::string& cell_name) const {
  return batches(cell_name).map([](std::vector<StoredBatch> all) {
    std::erase_if(
        all, [](const StoredBatch& batch) { return batch.quarantine.empty() || batch.discarded; });
    return all;
  });
}

Result<JobProgress> Trainer::progress(std::int64_t job) const {
  if (auto running = book_.find(job)) return *running;
  const auto stored = TRY(store_.job(job));
  return stored_progress(stored);
}

JobProgress Trainer::stored_progress(const StoredJob& job) const {
  JobProgress progress = progress_of(job);
  const auto present = registry_.in_force(job.cell);
  progress.in_force = present && job.model_version != 0 && present->version == job.model_version;
  return progress;
}

Result<std::vector<Trainer::DatedJob>> Trainer::jobs(const std::string& cell_name) const {
  const auto stored = TRY(store_.recent_jobs(cell_name, kJobsListed));
  std::vector<DatedJob> jobs;
  for (const StoredJob& job : stored) {
    auto now = TRY(progress(job.id));
    jobs.push_back({job, std::move(now)});
  }
  return jobs;
}

int Trainer::queued_jobs() const { return static_cast<int>(queue_.size()); }

}  // namespace trammel
