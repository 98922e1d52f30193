#include "server/trainer/job_batches.h"

#include <algorithm>
#include <utility>

#include "server/base/hash.h"
#include "server/measurement/files/batch_file.h"

namespace trammel {

namespace {

constexpr std::size_t kMostSessions = 50;   // newest batches that judge
constexpr std::size_t kIdOfSentBatch = 12;  // characters of its hash

}  // namespace

Status check_released(const StoredBatch& batch) {
  if (batch.quarantine.empty()) return {};
  return refused("batch {} of cell {} is in quarantine: {}", batch.id, batch.cell, batch.quarantine)
      .of("batch")
      .with_text(batch.id)
      .next("release it if it is good");
}

HoldOut held_out_to_judge(const TrainerOptions& options) {
  return held_out_by_service(options.validation_share, options.seed);
}

HoldOut held_out_of_diagnosis(const TrainerOptions& options, bool apply) {
  return apply ? held_out_to_judge(options) : drawn(0, options.seed);
}

Result<CheckedBatch> received_batch(const std::string& csv, const std::string& id, std::int64_t taken_in,
                                    const Cell& cell, const HoldOut& hold_out) {
  auto parsed = parse_batch(csv, "batch " + id);
  if (!parsed) return tl::make_unexpected(parsed.error());
  parsed->id = id;
  return check_against_cell(dated(std::move(*parsed), taken_in), cell, hold_out);
}

Result<CheckedBatch> sent_batch(const std::string& csv, std::int64_t taken_in, const Cell& cell,
                                const HoldOut& hold_out) {
  return received_batch(csv, "sent-" + sha256_hex(csv).substr(0, kIdOfSentBatch), taken_in, cell, hold_out);
}

JobBatches::JobBatches(const Store& store, const StoredJob& job, const Cell& cell, const TrainerOptions& options,
                       StoredDiagnosis asked)
    : store_(store),
      job_(job),
      cell_(cell),
      hold_out_(job.kind == JobKind::kDiagnose ? held_out_of_diagnosis(options, asked.apply)
                                               : held_out_to_judge(options)),
      asked_(std::move(asked)) {}

Result<CheckedBatch> JobBatches::first() { return own(job_.batch_ids.empty() ? "" : job_.batch_ids.front()); }

Result<CheckedBatch> JobBatches::to_learn_from() {
  const auto may_release = store_.may_release(job_.id);
  if (!may_release) return tl::make_unexpected(may_release.error());
  const auto stored = store_.batches(job_.cell);
  if (!stored) return tl::make_unexpected(stored.error());
  for (const StoredBatch& batch : *stored) {
    if (!is_own(batch.id) || *may_release) continue;
    if (const Status free = check_released(batch); !free) return tl::make_unexpected(free.error());
  }
  const auto sessions = judging_sessions();
  if (!sessions) return tl::make_unexpected(sessions.error());
  std::vector<CheckedBatch> batches;
  for (const std::string& id : job_.batch_ids) {
    const auto batch = own(id);
    if (!batch) return batch;
    batches.push_back(without_older_judges(*batch, *sessions));
  }
  return joined(batches, cell_);
}

Result<CheckedBatch> JobBatches::to_diagnose() {
  const auto batch = first();
  if (!batch || !asked_.apply) return batch;
  const auto sessions = judging_sessions();
  if (!sessions) return tl::make_unexpected(sessions.error());
  return without_older_judges(*batch, *sessions);
}

Result<std::vector<JudgingSession>> JobBatches::judging_sessions() {
  if (sessions_) return *sessions_;
  const auto batches = store_.batches(job_.cell);
  if (!batches) return tl::make_unexpected(batches.error());
  const auto may_judge = store_.batches_learned_from(job_.cell);
  if (!may_judge) return tl::make_unexpected(may_judge.error());
  std::vector<JudgingSession> newest_first;
  for (auto batch = batches->rbegin(); batch != batches->rend() && newest_first.size() < kMostSessions; ++batch) {
    if (!is_own(batch->id) && (!batch->quarantine.empty() || !may_judge->contains(batch->id))) continue;
    auto session = session_of(batch->id);
    if (!session) return tl::make_unexpected(session.error());
    if (*session) newest_first.push_back(std::move(**session));
  }
  std::reverse(newest_first.begin(), newest_first.end());
  judge_once(newest_first);
  return sessions_.emplace(std::move(newest_first));
}

Result<JobBatches::SessionsOfDiagnosis> JobBatches::sessions_of_diagnosis() {
  auto sessions = judging_sessions();
  if (!sessions) return tl::make_unexpected(sessions.error());
  const auto batch = first();
  if (!batch) return tl::make_unexpected(batch.error());
  const auto own = std::find_if(sessions->begin(), sessions->end(), [&](const JudgingSession& session) {
    return !job_.batch_ids.empty() && session.batch_id == batch->id();
  });
  const auto place = static_cast<std::size_t>(own - sessions->begin());
  if (own == sessions->end()) {
    // It came with the question and is not stored, or is older than those that judge.
    sessions->push_back(judging_session(*batch));
    judge_once(*sessions);
  }
  return SessionsOfDiagnosis{std::move(*sessions), place};
}

Result<CheckedBatch> JobBatches::own(const std::string& id) {
  if (const auto known = own_.find(id); known != own_.end()) return known->second;
  auto batch = [&]() -> Result<CheckedBatch> {
    if (id.empty()) return sent_batch(asked_.csv, job_.created_at, cell_, hold_out_);
    const auto stored = store_.batch(job_.cell, id);
    if (!stored) return tl::make_unexpected(stored.error());
    return received_batch(stored->csv, id, stored->accepted_at, cell_, hold_out_);
  }();
  if (batch) own_.emplace(id, *batch);
  return batch;
}

bool JobBatches::is_own(const std::string& id) const {
  return std::find(job_.batch_ids.begin(), job_.batch_ids.end(), id) != job_.batch_ids.end();
}

Result<std::optional<JudgingSession>> JobBatches::session_of(const std::string& id) {
  if (is_own(id)) {
    const auto batch = own(id);
    return batch ? std::optional(judging_session(*batch)) : std::nullopt;
  }
  const auto stored = store_.batch(job_.cell, id);
  if (!stored) return tl::make_unexpected(stored.error());
  const auto batch = received_batch(stored->csv, id, stored->accepted_at, cell_, hold_out_);
  return batch ? std::optional(judging_session(*batch)) : std::nullopt;
}

}  // namespace trammel
