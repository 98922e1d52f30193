// The part of a trainer that shares its store with other servers: it follows their changes, keeps
// its claims, and announces itself.
#include <pthread.h>

#include <chrono>
#include <set>
#include <utility>

#include "server/base/unix_time.h"
#include "server/trainer/trainer.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kFollowTick{2};  // if no notification of a change came

}  // namespace

void Trainer::follow(std::int64_t followed, const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "follower");
  while (!stop.stop_requested()) {
    keep_claim();  // so that a cancellation on another server takes effect at once
    if (const auto now = store_.counts()) {
      agree(now->descriptions);
      followed = follow_models(followed, now->changes);
      presence_.has_followed(followed);
    }
    follow_jobs();
    store_.wait_for_change(stop, kFollowTick);
  }
}

std::int64_t Trainer::follow_models(std::int64_t followed, std::int64_t made) {
  if (made == followed) return followed;
  const bool lost = made < followed;
  if (lost && trouble_listener_)
    trouble_listener_(
        fmt::format("the record has {} changes and had {}: it is of an earlier moment", made,
                    followed),
        false);
  const auto changed = store_.cells_changed_after(lost ? 0 : followed);
  if (!changed) return followed;
  bool all = true;
  for (const std::string& cell : *changed) {
    if (cells().contains(cell) && !history_.follow(cell)) all = false;
  }
  return all ? made : followed;
}

void Trainer::follow_jobs() {
  // Called before the lock, so that submitting clients do not wait for it. Later jobs are seen at
  // the next look.
  const auto to_take = store_.jobs_to_take();
  if (!to_take) return;
  const MutexLock lock(submit_mutex_);
  std::set<std::int64_t> elsewhere, ready;
  for (const JobProgress& known : book_.unfinished()) {
    if (!to_take->contains(known.job) && known.job != runner_.claimed())
      elsewhere.insert(known.job);
  }
  const std::set<std::int64_t> waiting = queue_.jobs();
  for (const auto& [id, cell] : *to_take) {
    if (!waiting.contains(id) && cells_.find(cell)) ready.insert(id);
  }
  std::set<std::int64_t> wanted = ready;
  wanted.insert(elsewhere.begin(), elsewhere.end());
  auto jobs = store_.jobs(wanted);
  if (!jobs) return;
  const auto came = store_.came_with_batches(ready);
  std::vector<std::string> notices;  // the start of a server reports them
  for (StoredJob& job : *jobs) {
    if (elsewhere.contains(job.id)) follow_job(job);
    if (!ready.contains(job.id) || is_over(job) || !can_take_up(job, notices).value_or(false))
      continue;
    job.state = JobState::kQueued;
    enqueue(job, !came || !came->contains(job.id));
  }
}

void Trainer::follow_job(const StoredJob& job) {
  const auto known = book_.find(job.id);
  if (!known) return;
  const JobProgress now = stored_progress(job);
  if (is_over(job)) static_cast<void>(queue_.remove(job.id));
  if (is_over(job) || now.stage != known->stage || now.what != known->what) book_.report(now);
}

void Trainer::agree(std::int64_t descriptions) {
  const MutexLock lock(agree_mutex_);
  if (!is_present_ || (descriptions == descriptions_ && cells_.all_answer())) return;
  const auto mine = presence_.descriptions();
  auto disputes = store_.agree_on_cells(mine, descriptions_ < 0, agreed_);
  if (!disputes) return;
  descriptions_ = descriptions;  // later descriptions are compared at the next look
  std::map<std::string, ApartCell> apart;
  for (auto& [cell, why] : *disputes) apart[cell] = {std::move(why), agreed_.contains(cell)};
  for (const auto& [cell, files] : mine) {
    if (!apart.contains(cell)) agreed_.insert(cell);
  }
  if (apart != cells_.apart()) {
    cells_.set_apart(std::move(apart));
    presence_.has_changed();
  }
  const auto running = book_.find(runner_.claimed());
  if (!running || cells_.find(running->cell)) return;
  runner_.lose_claim(running->job);  // it is being computed from the wrong files
  static_cast<void>(queue_.cancel(running->job));
}

void Trainer::beat(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "heartbeat");
  for (auto due = std::chrono::steady_clock::now(); !stop.stop_requested();
       presence_.wait(stop, due)) {
    const bool is_due = std::chrono::steady_clock::now() >= due;
    if (is_due) due = std::chrono::steady_clock::now() + kHeartbeat;
    if (is_due) keep_claim();
    if (store_.tell_presence(self())) is_present_ = true;
    if (!is_due) continue;
    if (auto known = store_.servers(false)) presence_.seen(std::move(*known));
  }
}

ServerSelf Trainer::self() const {
  std::map<std::string, std::string> why;
  for (const auto& [cell, one] : cells_.apart()) why.emplace(cell, one.why);
  for (const auto& [cell, trouble] : history_.cell_troubles()) why.emplace(cell, trouble.what);
  ServerSelf self = options_.self;
  self.server = store_.server();
  self.trains = options_.trains;
  self.followed = presence_.followed();
  auto files = presence_.descriptions();
  for (const auto& [name, cell] : cells()) {
    const bool is_apart = cells_.why_apart(name).has_value();
    self.cells[name] = {is_apart ? 0 : registry_.version_in_force(name), std::move(files[name]),
                        std::move(why[name]), is_apart};
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
  for (const auto& [cell, one] : cells_.apart()) {
    if (one.answers)
      troubles.try_emplace(cell, CellTrouble{CellTrouble::Kind::kFormerFiles, one.why});
    if (!one.answers) troubles[cell] = {CellTrouble::Kind::kSetApart, one.why};
  }
  return troubles;
}

void Trainer::keep_claim() {
  const std::int64_t job = runner_.claimed();
  if (job == 0) return;
  const auto claim = store_.renew_claim(job);
  if (!claim) return;  // while the record is away, nobody else can claim it either
  if (!claim->is_held) runner_.lose_claim(job);
  if (!claim->is_held || claim->cancelled_by)
    static_cast<void>(queue_.cancel(job, claim->cancelled_by.value_or("")));
}

Status Trainer::cancel_in_record(const StoredJob& job, const ChangeId& by) {
  const JobOutcome outcome = cancelled_outcome(by.who);
  // The store learns of the cancellation before this server does. If this server dies now, its
  // successor also ends the job.
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
