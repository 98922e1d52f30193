#include "server/trainer/job_sources.h"

#include <algorithm>
#include <set>

namespace trammel {

namespace {

constexpr std::size_t kMostSessions = 50;  // newest batches that judge
constexpr std::int64_t kSecondsPerDay = 86400;

Status check_own(const Store& store, const StoredJob& job, const std::set<std::string>& own,
                 const std::vector<StoredBatch>& stored) {
  if (job.kind() != JobKind::kTrain) return {};
  const auto may_release = TRY(store.may_release(job.id));
  for (const StoredBatch& batch : stored) {
    if (!own.contains(batch.id) || may_release) continue;
    TRY(check_released(batch));
  }
  return {};
}

/// The newest judges of `stored`; see judging_sources(). `own`: judge also where they are in
/// quarantine.
std::vector<BatchSource> newest_judges(const std::vector<StoredBatch>& stored,
                                       const std::set<std::string>& may_judge,
                                       const std::set<std::string>& own) {
  std::vector<BatchSource> judging;
  for (auto batch = stored.rbegin(); batch != stored.rend() && judging.size() < kMostSessions;
       ++batch) {
    const bool judges =
        own.contains(batch->id) || (batch->quarantine.empty() && may_judge.contains(batch->id));
    if (judges && !batch->pruned) judging.push_back({batch->id, true});
  }
  std::reverse(judging.begin(), judging.end());
  return judging;
}

}  // namespace

Status check_released(const StoredBatch& batch) {
  if (batch.quarantine.empty()) return {};
  return refused("batch {} of cell {} is in quarantine: {}", batch.id, batch.cell, batch.quarantine)
      .of("batch")
      .with_text(batch.id)
      .next("release it if it is good");
}

Result<std::vector<std::string>> earlier_sessions(const Store& store, const StoredJob& job,
                                                  const SessionRule& rule, int max_poses) {
  const std::set<std::string> own(job.batch_ids.begin(), job.batch_ids.end());
  const auto stored = TRY(store.batches(job.cell));
  const auto learned = TRY(store.batches_learned_from(job.cell));
  std::int64_t newest = 0, poses = 0;
  for (const StoredBatch& batch : stored) {
    if (!own.contains(batch.id)) continue;
    newest = std::max(newest, batch.accepted_at);
    poses += batch.poses;
  }
  std::vector<std::string> earlier;
  for (auto batch = stored.rbegin(); batch != stored.rend(); ++batch) {
    if (own.contains(batch->id) || !batch->quarantine.empty() || batch->pruned ||
        !learned.contains(batch->id))
      continue;
    const bool too_old = rule.kind == SessionRule::Kind::kDays &&
                         batch->accepted_at < newest - kSecondsPerDay * rule.count;
    if (too_old) continue;  // servers of one record have clocks of their own
    const bool too_many = rule.kind == SessionRule::Kind::kLast &&
                          earlier.size() + own.size() >= static_cast<std::size_t>(rule.count);
    if (too_many || poses + batch->poses > max_poses) break;
    poses += batch->poses;
    earlier.push_back(batch->id);
  }
  std::reverse(earlier.begin(), earlier.end());
  return earlier;
}

Result<std::vector<BatchSource>> judging_sources(const Store& store, const std::string& cell,
                                                 const std::set<std::string>& also) {
  const auto stored = TRY(store.batches(cell));
  auto may_judge = TRY(store.batches_learned_from(cell));
  may_judge.insert(also.begin(), also.end());
  return newest_judges(stored, may_judge, {});
}

Result<std::vector<BatchSource>> batch_sources(const Store& store, const StoredJob& job,
                                               bool judged,
                                               const std::vector<std::string>& earlier) {
  const std::set<std::string> own(job.batch_ids.begin(), job.batch_ids.end());
  const auto stored = TRY(store.batches(job.cell));
  TRY(check_own(store, job, own, stored));
  std::vector<BatchSource> judging;
  if (judged) {
    const auto may_judge = TRY(store.batches_learned_from(job.cell));
    judging = newest_judges(stored, may_judge, own);
  }
  std::vector<BatchSource> sources;
  for (const std::vector<std::string>* some : {&job.batch_ids, &earlier}) {
    for (const std::string& id : *some) {
      const bool judges = std::any_of(judging.begin(), judging.end(),
                                      [&](const BatchSource& one) { return one.id == id; });
      if (!judges) sources.push_back({id, false});
    }
  }
  sources.insert(sources.end(), judging.begin(), judging.end());
  return sources;
}

}  // namespace trammel
