// What a trainer does where several servers share its store: it follows what others change, keeps its claims, and says
// that it is there.
#include <pthread.h>

#include <chrono>
#include <set>
#include <utility>

#include "server/base/unix_time.h"
#include "server/trainer/trainer.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kFollowTick{2};  // where no word came of a change

}  // namespace

void Trainer::follow(std::int64_t followed, const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "follower");
  while (!stop.stop_requested()) {
    keep_claim();
    agree();
    followed = follow_models(followed);
    presence_.has_followed(followed);
    keep_claim();
    follow_jobs();
    store_.wait_for_change(stop, kFollowTick);
  }
}

std::int64_t Trainer::follow_models(std::int64_t followed) {
  const auto made = store_.changes_made();
  if (!made || *made == followed) return followed;
  const bool lost = *made < followed;
  if (lost && trouble_listener_)
    trouble_listener_(fmt::format("the record has {} changes and had {}: it is of an earlier moment", *made, followed),
                      false);
  const auto changed = store_.cells_changed_after(lost ? 0 : followed);
  if (!changed) return followed;
  bool all = true;
  for (const std::string& cell : *changed) {
    if (cells().contains(cell) && !history_.follow(cell)) all = false;
    keep_claim();  // a record that answers slowly must not end the lease
  }
  return all ? *made : followed;
}

void Trainer::follow_jobs() {
  const MutexLock lock(submit_mutex_);
  const auto to_take = store_.jobs_to_take();
  if (!to_take) return;
  for (const JobProgress& known : book_.unfinished()) {
    if (to_take->contains(known.job) || known.job == runner_.claimed()) continue;
    const auto job = store_.job(known.job);
    if (!job || !book_.find(known.job)) continue;
    const bool is_over = job->state == JobState::kDone || job->state == JobState::kFailed;
    const JobProgress now = stored_progress(*job);
    if (is_over) static_cast<void>(queue_.remove(known.job));
    if (is_over || now.stage != known.stage || now.what != known.what) book_.report(now);
  }
  std::vector<std::string> notices;  // the start of a server says them
  const std::set<std::int64_t> known = queue_.jobs();
  for (const std::int64_t id : *to_take) {
    if (known.contains(id)) continue;
    auto job = store_.job(id);
    const bool is_over = job && (job->state == JobState::kDone || job->state == JobState::kFailed);  // meanwhile
    if (!job || is_over || !can_take_up(*job, notices).value_or(false)) continue;
    job->state = JobState::kQueued;
    enqueue(*job, was_asked_for(*job).value_or(true));
  }
}

void Trainer::agree() {
  const MutexLock lock(agree_mutex_);
  const auto made = store_.descriptions_made();
  const bool is_settled = made && *made == descriptions_ && cells_.apart().empty();
  if (!made || !is_present_ || is_settled) return;
  auto apart = store_.agree_on_cells(presence_.descriptions(), descriptions_ < 0);
  if (!apart) return;
  descriptions_ = *made;  // what was told since then is compared by the next look
  if (*apart != cells_.apart()) {
    cells_.set_apart(std::move(*apart));
    presence_.has_changed();
  }
  const auto running = book_.find(runner_.claimed());
  if (!running || !cells_.why_apart(running->cell)) return;
  runner_.lose_claim();  // it is computed from the wrong files
  static_cast<void>(queue_.cancel(running->job));
}

void Trainer::beat(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "heartbeat");
  for (auto due = std::chrono::steady_clock::now(); !stop.stop_requested(); presence_.wait(stop, due)) {
    const bool is_due = std::chrono::steady_clock::now() >= due;
    if (is_due) due = std::chrono::steady_clock::now() + kHeartbeat;
    if (is_due) keep_claim();
    if (store_.tell_presence(self())) is_present_ = true;
    if (!is_due) continue;
    if (auto known = store_.servers(false)) presence_.seen(std::move(*known));
  }
}

ServerSelf Trainer::self() const {
  std::map<std::string, std::string> why = cells_.apart();
  for (const auto& [cell, trouble] : history_.cell_troubles()) why.emplace(cell, trouble.what);
  ServerSelf self = options_.self;
  self.server = store_.server();
  self.trains = options_.trains;
  self.followed = presence_.followed();
  auto files = presence_.descriptions();
  for (const auto& [name, cell] : cells()) {
    const bool is_apart = cells_.why_apart(name).has_value();
    self.cells[name] = {is_apart ? 0 : registry_.version_in_force(name), std::move(files[name]), std::move(why[name])};
  }
  return self;
}

std::vector<ServerInRecord> Trainer::servers_seen() const {
  return store_.is_shared() ? presence_.seen() : std::vector<ServerInRecord>{alone()};
}

Result<std::vector<ServerInRecord>> Trainer::servers() const {
  if (store_.is_shared()) return store_.servers(true);
  return std::vector<ServerInRecord>{alone()};
}

ServerInRecord Trainer::alone() const {
  ServerInRecord one;
  one.self = self();
  one.since = began_at_;
  one.heard_at = unix_now();
  if (const std::int64_t job = runner_.claimed(); job != 0) {
    if (const auto running = book_.find(job)) one.works_on.push_back({job, running->cell});
  }
  return one;
}

std::map<std::string, CellTrouble> Trainer::cell_troubles() const {
  auto troubles = history_.cell_troubles();
  for (const auto& [cell, why] : cells_.apart()) troubles[cell] = {CellTrouble::Kind::kSetApart, why};
  return troubles;
}

void Trainer::keep_claim() {
  const std::int64_t job = runner_.claimed();
  if (job == 0) return;
  const auto claim = store_.renew_claim(job);
  if (!claim) return;  // a record that is away lets nobody else claim it, either
  if (!claim->is_held) runner_.lose_claim();
  if (!claim->is_held || claim->cancelled_by) static_cast<void>(queue_.cancel(job, claim->cancelled_by.value_or("")));
}

Status Trainer::cancel_in_record(const StoredJob& job, const ChangeId& by) {
  const JobOutcome outcome = cancelled_outcome(by.who);
  // Before it is told here: whoever takes the job up if this server dies now ends it, too.
  const auto cancelled = TRY(store_.cancel_job(job.id, outcome, by));
  if (cancelled == CancelledJob::kEnded || runner_.claimed() == job.id)
    static_cast<void>(queue_.cancel(job.id, by.who));
  if (cancelled == CancelledJob::kAsked) return {};
  JobProgress progress = progress_of(job);
  progress.stage = JobStage::kFailed;
  progress.what = outcome.why;
  progress.outcome = outcome;
  book_.report(progress);
  return {};
}

}  // namespace trammel
