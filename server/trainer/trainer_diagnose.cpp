#include <algorithm>
#include <utility>

#include "server/base/hash.h"
#include "server/base/unix_time.h"
#include "server/diagnose/diagnose.h"
#include "server/diagnose/triage.h"
#include "server/measurement/files/batch_file.h"
#include "server/report/diagnosis_json.h"
#include "server/report/diagnosis_page.h"
#include "server/trainer/acceptance/judging.h"
#include "server/trainer/pipeline/extend.h"
#include "server/trainer/trainer.h"

// What the trainer does besides training: looks at a batch before it is learned from, and diagnoses one.

namespace trammel {

namespace {

constexpr double kDiagnosisShare = 0.6;     // of a diagnosis that is applied
constexpr double kSupportShare = 0.1;       // asking each cause; the rest is the training
constexpr std::size_t kIdOfSentBatch = 12;  // characters of its hash

std::string findings_text(const Diagnosis& diagnosis) {
  return diagnosis_json(diagnosis).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

/// The cell as it is served: with the error sources of the model in force.
std::shared_ptr<const Cell> as_served(const std::shared_ptr<const Cell>& cell, const ServedModel* in_force,
                                      const MeasurementBatch& batch) {
  if (in_force == nullptr) return cell;
  auto served = std::make_shared<Cell>(*cell);
  served->model.error_sources = sources_in_force(in_force->model, *cell, batch);
  return served;
}

}  // namespace

Result<std::int64_t> Trainer::diagnose(const std::string& cell_name, const std::string& batch_id,
                                       const std::string& csv, bool apply) {
  const auto cell_found = cell(cell_name);
  if (!cell_found) return tl::make_unexpected(cell_found.error());
  if (!batch_id.empty() && !csv.empty()) {
    return failure(ErrorCode::kUsage, "a diagnosis is of a stored batch or of one that is sent, not of both");
  }
  StoredJob job;
  job.kind = JobKind::kDiagnose;
  job.cell = cell_name;
  job.created_at = unix_now();
  if (csv.empty()) {
    const auto stored = store_.batches(cell_name);
    if (!stored) return tl::make_unexpected(stored.error());
    if (stored->empty())
      return failure(ErrorCode::kNotFound, "cell {} has no batch to diagnose", cell_name).of("batch");
    job.batch_ids = {batch_id.empty() ? stored->back().id : batch_id};
    if (apply) {
      const auto asked = store_.batch(cell_name, job.batch_ids.front());
      if (!asked) return tl::make_unexpected(asked.error());
      if (const Status free = check_released(*asked); !free) return tl::make_unexpected(free.error());
    }
  } else {
    const auto sent = batch_to_diagnose(job, {csv, apply, "", ""}, **cell_found);
    if (!sent) return tl::make_unexpected(sent.error());
    if (const auto poses = static_cast<int>(sent->measurements.size()); poses > options_.max_poses) {
      return failure(ErrorCode::kTooLarge, "the batch has {} poses, limit {}", poses, options_.max_poses)
          .of("poses")
          .beyond(poses, options_.max_poses);
    }
  }
  const std::lock_guard lock(submit_mutex_);
  if (auto room = check_room(); !room) return tl::make_unexpected(room.error());
  const auto accepted = store_.add_diagnosis(job, {csv, apply, "", ""});
  if (!accepted) return tl::make_unexpected(accepted.error());
  enqueue(*accepted);
  return accepted->id;
}

Result<StoredDiagnosis> Trainer::diagnosis(std::int64_t job) const {
  auto found = store_.diagnosis(job);
  if (!found || !found->findings.empty()) return found;
  const auto state = store_.job(job);
  if (!state) return tl::make_unexpected(state.error());
  if (state->state == JobState::kFailed) return refused("job {} failed: {}", job, state->message);
  return failure(ErrorCode::kBusy, "job {} is not done yet", job).of("job").with_value(job).next("try again later");
}

Result<MeasurementBatch> Trainer::batch_to_diagnose(const StoredJob& job, const StoredDiagnosis& asked,
                                                    const Cell& cell) const {
  std::string csv = asked.csv;
  std::string id = "sent-" + sha256_hex(csv).substr(0, kIdOfSentBatch);
  std::int64_t taken_in = job.created_at;
  if (!job.batch_ids.empty()) {
    auto stored = store_.batch(job.cell, job.batch_ids.front());
    if (!stored) return tl::make_unexpected(stored.error());
    csv = std::move(stored->csv);
    id = stored->id;
    taken_in = stored->accepted_at;
  }
  auto parsed = parse_batch(csv, "batch " + id);
  if (!parsed) return parsed;
  parsed->id = id;
  return check_against_cell(dated(std::move(*parsed), taken_in), cell);
}

Status Trainer::attempt_diagnosis(const StoredJob& job, const std::shared_ptr<const Cell>& cell_found,
                                  JobProgress progress, const std::stop_token& stop) {
  const auto asked = store_.diagnosis(job.id);
  if (!asked) return tl::make_unexpected(asked.error());
  auto batch = batch_to_diagnose(job, *asked, *cell_found);
  if (!batch) return tl::make_unexpected(batch.error());
  // What is to judge an extended model must not have been looked at.
  if (asked->apply) {
    const auto sessions = judging_sessions(job);
    if (!sessions) return tl::make_unexpected(sessions.error());
    *batch = held_out_by_service(std::move(*batch), options_.validation_share, options_.seed);
    *batch = without_older_judges(std::move(*batch), *sessions);
  }
  DiagnoseOptions options;
  options.seed = options_.seed;
  const double whole = asked->apply ? kDiagnosisShare : 1;
  options.progress = [report = reporter(progress, stop), whole](const std::string& stage, double share) mutable {
    return report("diagnosing: " + stage, whole * share);
  };
  const auto present = registry_.in_force(job.cell);
  const auto served = as_served(cell_found, present.get(), *batch);
  const auto diagnosis = trammel::diagnose(served, *batch, options);
  if (!diagnosis) return tl::make_unexpected(with_rows_set_aside(diagnosis.error(), *batch));
  const Status stored = store_.store_findings(job.id, findings_text(*diagnosis), diagnosis_page(*diagnosis, *served));
  if (!stored) return stored;
  const Status can_apply = check_can_extend(*diagnosis);
  if (!asked->apply || !can_apply) {
    const std::string stays = present ? fmt::format("; version {} stays in force", present->version) : "";
    return finish(std::move(progress), asked->apply ? "nothing applied: " + sentence(can_apply.error()) + stays
                                                    : std::string(to_string(diagnosis->verdict)));
  }
  const auto supported =
      supported_sources(served, *batch, *diagnosis, options_.seed, [report = reporter(progress, stop)](double share) {
        return report("asking of each cause what it is worth", kDiagnosisShare + kSupportShare * share);
      });
  if (!supported) return tl::make_unexpected(supported.error());
  std::vector<std::string> sources = served->model.error_sources;
  sources.insert(sources.end(), supported->sources.begin(), supported->sources.end());
  StoredJob extended = job;
  extended.level = level_of(sources);
  TrainOptions training = train_options(extended, *cell_found, progress, stop);
  training.progress = [report = training.progress](const std::string& stage, double share) {
    constexpr double kDone = kDiagnosisShare + kSupportShare;
    return report(stage, kDone + (1 - kDone) * share);
  };
  const auto model = train(cell_found, *batch, training);
  if (!model) return tl::make_unexpected(model.error());
  return keep(*model, std::move(progress), Bar::kBetterBeyondChance, to_string(supported->left_out), &*diagnosis);
}

Status Trainer::finish(JobProgress progress, const std::string& outcome) {
  if (const Status done = store_.set_job_done(progress.job, outcome); !done) return done;
  progress.stage = JobStage::kDone;
  progress.what = outcome;
  progress.share = 1;
  report(progress);
  return {};
}

Result<std::string> Trainer::hold_against_model_in_force(const StoredJob& job, const Cell& cell) {
  const auto served = registry_.in_force(job.cell);
  if (!served || job.batch_ids.size() != 1) return "";
  const auto stored = store_.batch(job.cell, job.batch_ids.front());
  if (!stored) return tl::make_unexpected(stored.error());
  if (stored->job != job.id) return "";  // somebody asked for this training, knowing the batch
  auto batch = batch_to_diagnose(job, {}, cell);
  if (!batch) return tl::make_unexpected(batch.error());
  std::erase_if(batch->measurements, [&](const Measurement& m) { return !knows(served->model, m); });
  if (batch->measurements.empty()) return "";  // nothing to compare
  const Triage seen = triage(served->model, *batch);
  if (seen.learn) return seen.verdict == TriageVerdict::kClean ? "" : seen.sentence;
  if (const Status kept = store_.set_quarantine(job.cell, stored->id, seen.sentence); !kept) {
    return tl::make_unexpected(kept.error());
  }
  return refused("batch {} is in quarantine: {}; nothing was learned from it", stored->id, seen.sentence)
      .of("batch")
      .with_text(stored->id)
      .next("retrain --release if it is good");
}

}  // namespace trammel
