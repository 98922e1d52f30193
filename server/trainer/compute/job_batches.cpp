#include "server/trainer/compute/job_batches.h"

#include <algorithm>
#include <utility>

#include "server/base/hash.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/gauges.h"

namespace trammel {

namespace {

constexpr std::size_t kIdOfSentBatch = 12;  // characters of its hash

}  // namespace

HoldOut held_out_of_diagnosis(double validation_share, std::uint64_t seed, bool apply) {
  return apply ? held_out_by_service(validation_share, seed) : drawn(0, seed);
}

Result<CheckedBatch> received_batch(const BatchText& text, const Cell& cell,
                                    const HoldOut& hold_out, const BatchReads& reads) {
  const std::string id =
      text.id.empty() ? "sent-" + sha256_hex(text.csv).substr(0, kIdOfSentBatch) : text.id;
  if (reads) reads(id);
  auto parsed = TRY(parse_batch(text.csv, "batch " + id));
  parsed.id = id;
  TRY(require_positions(parsed, "the service"));
  return check_against_cell(dated(std::move(parsed), text.taken_in), cell, hold_out);
}

JobBatches::JobBatches(const Cell& cell, HoldOut hold_out, BatchReads reads,
                       std::vector<std::string> own, std::vector<std::string> earlier)
    : cell_(cell),
      hold_out_(std::move(hold_out)),
      reads_(std::move(reads)),
      own_ids_(std::move(own)),
      earlier_ids_(std::move(earlier)) {}

void JobBatches::add(const BatchText& text, bool judges) {
  auto batch = received_batch(text, cell_, hold_out_, reads_);
  if (judges && batch) {
    sessions_.push_back(judging_session(*batch));
    judge_once_ = false;
  }
  const bool earlier =
      std::find(earlier_ids_.begin(), earlier_ids_.end(), text.id) != earlier_ids_.end();
  if (text.id.empty() || is_own(text.id) || earlier) own_.emplace(text.id, std::move(batch));
}

Result<CheckedBatch> JobBatches::first() const {
  return own(own_ids_.empty() ? "" : own_ids_.front());
}

Result<CheckedBatch> JobBatches::first_without_older_judges() {
  const auto batch = first();
  if (!batch) return batch;
  return without_older_judges(*batch, judging_sessions());
}

Result<CheckedBatch> JobBatches::to_learn_from() {
  std::vector<CheckedBatch> batches;
  for (const std::string& id : earlier_ids_) {
    const auto batch = own(id);
    if (batch) batches.push_back(without_older_judges(*batch, judging_sessions()));
  }
  for (const std::string& id : own_ids_) {
    const auto batch = own(id);
    if (!batch) return batch;
    batches.push_back(without_older_judges(*batch, judging_sessions()));
  }
  return joined(std::move(batches));
}

const std::vector<JudgingSession>& JobBatches::judging_sessions() {
  if (!judge_once_) judge_once(sessions_);
  judge_once_ = true;
  return sessions_;
}

Result<JobBatches::SessionsOfDiagnosis> JobBatches::sessions_of_diagnosis() {
  std::vector<JudgingSession> sessions = judging_sessions();
  const auto batch = TRY(first());
  const auto own =
      std::find_if(sessions.begin(), sessions.end(), [&](const JudgingSession& session) {
        return !own_ids_.empty() && session.batch_id == batch.id();
      });
  const auto place = static_cast<std::size_t>(own - sessions.begin());
  if (own == sessions.end()) {
    // It came with the request and is not stored, or is older than the judging batches.
    sessions.push_back(judging_session(batch));
    judge_once(sessions);
  }
  return SessionsOfDiagnosis{std::move(sessions), place};
}

Result<CheckedBatch> JobBatches::own(const std::string& id) const {
  const auto known = own_.find(id);
  if (known != own_.end()) return known->second;
  return failure(ErrorCode::kInternal, "batch {} was not given to the computing", id);
}

bool JobBatches::is_own(const std::string& id) const {
  return std::find(own_ids_.begin(), own_ids_.end(), id) != own_ids_.end();
}

}  // namespace trammel
