#include "server/trainer/job_runner.h"

#include <chrono>
#include <exception>
#include <utility>

#include "server/base/unix_time.h"
#include "server/compensate/model_notes.h"
#include "server/diagnose/diagnose.h"
#include "server/diagnose/triage.h"
#include "server/report/diagnosis_json.h"
#include "server/report/diagnosis_page.h"
#include "server/trainer/job_batches.h"
#include "server/trainer/pipeline/extend.h"
#include "server/trainer/pipeline/lasting_sources.h"
#include "server/trainer/pipeline/successor.h"

namespace trammel {

namespace {

constexpr std::chrono::milliseconds kReportInterval{50};  // of a running job, for its watchers
constexpr double kDiagnosisShare = 0.6;                   // of a diagnosis that is applied; the rest is the training

std::string findings_text(const Diagnosis& diagnosis) {
  return diagnosis_json(diagnosis).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

/// The cell as it is served: with the error sources of the model in force.
std::shared_ptr<const Cell> as_served(const std::shared_ptr<const Cell>& cell, const ServedModel* in_force,
                                      const CheckedBatch& batch) {
  if (in_force == nullptr) return cell;
  auto served = std::make_shared<Cell>(*cell);
  served->model.error_sources = sources_in_force(in_force->model, *cell, batch);
  return served;
}

JobProgress progress_at(const StoredJob& job, JobStage stage) {
  JobProgress progress = progress_of(job);
  progress.stage = stage;
  return progress;
}

JobVerdict verdict_of(const Error& error) {
  return error.code == ErrorCode::kInternal ? JobVerdict::kBroken : JobVerdict::kRefused;
}

/// `; ` between what is said.
std::string joined_by_semicolons(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) {
    if (!part.empty()) text += "; " + part;
  }
  return text;
}

}  // namespace

JobRunner::JobRunner(const ServedCells& cells, Store& store, const ModelRegistry& registry, ModelHistory& history,
                     ProgressBook& book, const TrainerOptions& options)
    : cells_(cells), store_(store), registry_(registry), history_(history), book_(book), options_(options) {}

void JobRunner::run(std::int64_t id, const StopRequests& stop) {
  const Status outcome = [&]() -> Status {
    try {
      return attempt(id, stop);
    } catch (const std::exception& error) {  // out of memory, for one: this training ends, the service goes on
      return failure(ErrorCode::kInternal, "the training broke off: {}", error.what());
    }
  }();
  if (outcome) return;
  JobProgress progress;
  progress.job = id;
  if (const auto stored = store_.job(id)) progress = progress_of(*stored);
  if (stop.service.stop_requested() && !stop.job.stop_requested()) {
    // Should the store refuse, the job counts as interrupted and is taken up all the same.
    static_cast<void>(store_.set_job_queued(id));
    progress.stage = JobStage::kQueued;
    return book_.report(progress);
  }
  progress.stage = JobStage::kFailed;
  progress.what = stop.job.stop_requested() ? cancelled_outcome().why : sentence(outcome.error());
  progress.outcome =
      stop.job.stop_requested() ? cancelled_outcome() : failed_outcome(outcome.error(), verdict_of(outcome.error()));
  const Status failed = store_.set_job_failed(id, progress.what, progress.outcome);
  if (!failed && failed.error().code == ErrorCode::kNotFound) return;  // its model is stored: it has not failed
  book_.report(progress);
}

Status JobRunner::attempt(std::int64_t id, const StopRequests& stop) {
  const auto job = store_.job(id);
  if (!job) return tl::make_unexpected(job.error());
  const auto cell = find_cell(cells_, job->cell);
  if (!cell) return tl::make_unexpected(cell.error());
  if (auto running = store_.set_job_running(job->id); !running) return running;
  book_.report(progress_at(*job, JobStage::kTraining));
  if (job->kind == JobKind::kTrain) {
    JobBatches batches(store_, *job, **cell, options_);
    return attempt_training(*job, batches, stop);
  }
  const auto asked = store_.diagnosis(job->id);
  if (!asked) return tl::make_unexpected(asked.error());
  JobBatches batches(store_, *job, **cell, options_, *asked);
  return attempt_diagnosis(*job, batches, asked->apply, stop);
}

Status JobRunner::attempt_training(const StoredJob& job, JobBatches& batches, const StopRequests& stop) {
  const auto looked_at = hold_against_model_in_force(job, batches);
  if (!looked_at) return tl::make_unexpected(looked_at.error());
  const auto batch = batches.to_learn_from();
  if (!batch) return tl::make_unexpected(batch.error());
  const bool as_usual = job.level.empty() && job.bias.empty();
  const auto present = as_usual ? registry_.in_force(job.cell) : nullptr;
  const auto successor = train_successor(cells_.at(job.cell), *batch, present.get(), train_options(job, stop));
  if (!successor) return tl::make_unexpected(successor.error());
  report_storing(job);
  auto sessions = batches.judging_sessions();
  if (!sessions) return tl::make_unexpected(sessions.error());
  const std::string seen = looked_at->empty() ? "" : "the batch: " + *looked_at;
  return keep(
      {successor->model, job, Bar::kBetter, std::move(*sessions), joined_by_semicolons({seen, successor->note})}, stop);
}

Status JobRunner::attempt_diagnosis(const StoredJob& job, JobBatches& batches, bool apply, const StopRequests& stop) {
  // What is to judge an extended model must not have been looked at.
  const auto batch = batches.to_diagnose();
  if (!batch) return tl::make_unexpected(batch.error());
  DiagnoseOptions options;
  options.seed = options_.seed;
  options.progress = [report = reporter(job, stop), whole = apply ? kDiagnosisShare : 1](const std::string& stage,
                                                                                         double share) {
    return report("diagnosing: " + stage, whole * share);
  };
  const auto present = registry_.in_force(job.cell);
  const auto served = as_served(cells_.at(job.cell), present.get(), *batch);
  const auto diagnosis = trammel::diagnose(served, *batch, options);
  if (!diagnosis) return tl::make_unexpected(with_rows_set_aside(diagnosis.error(), *batch));
  const Status stored = store_.store_findings(job.id, findings_text(*diagnosis), diagnosis_page(*diagnosis, *served));
  if (!stored) return stored;
  JobOutcome outcome;
  outcome.verdict = JobVerdict::kDiagnosed;
  outcome.why = diagnosis->sentence;
  if (!apply) return finish(job, std::string(to_string(diagnosis->verdict)), outcome);
  if (const Status can_apply = check_can_extend(*diagnosis); !can_apply) {
    const std::string stays = present ? fmt::format("; version {} stays in force", present->version) : "";
    outcome.verdict = JobVerdict::kNothingApplied;
    outcome.why = sentence(can_apply.error());
    return finish(job, "nothing applied: " + outcome.why + stays, outcome);
  }
  return this->apply(job, batches, *batch, served->model.error_sources, *diagnosis, stop);
}

Status JobRunner::apply(const StoredJob& job, JobBatches& batches, const CheckedBatch& batch,
                        const std::vector<std::string>& own, const Diagnosis& diagnosis, const StopRequests& stop) {
  TrainOptions options = train_options(job, stop);
  options.progress = [report = options.progress](const std::string& stage, double share) {
    return report(stage, kDiagnosisShare + (1 - kDiagnosisShare) * share);
  };
  const auto extended = extended_model(cells_.at(job.cell), own, batch, diagnosis, options);
  if (!extended) return tl::make_unexpected(extended.error());
  report_storing(job);
  auto found = batches.sessions_of_diagnosis();
  if (!found) return tl::make_unexpected(found.error());
  MeasurementBatch& own_judges = found->sessions[found->own].judges;
  Judges judges = judges_of(diagnosis, std::move(own_judges));
  own_judges = std::move(judges.batch);
  return keep({extended->model, job, Bar::kBetterBeyondChance, std::move(found->sessions),
               judged_without(judges.left_out) + joined_by_semicolons({to_string(extended->left_out)})},
              stop);
}

Result<std::string> JobRunner::hold_against_model_in_force(const StoredJob& job, JobBatches& batches) {
  const auto served = registry_.in_force(job.cell);
  if (!served || job.batch_ids.size() != 1) return "";
  const std::string& id = job.batch_ids.front();
  const auto stored = store_.batch_record(job.cell, id);
  if (!stored) return tl::make_unexpected(stored.error());
  if (stored->job != job.id) return "";  // somebody asked for this training, knowing the batch
  const auto batch = batches.first();
  if (!batch) return tl::make_unexpected(batch.error());
  const Triage seen = triage(served->model, *batch);
  if (seen.learn) return seen.verdict == TriageVerdict::kClean ? "" : seen.sentence;
  if (const Status kept = store_.set_quarantine(job.cell, id, seen.sentence); !kept) {
    return tl::make_unexpected(kept.error());
  }
  return refused("batch {} is in quarantine: {}; nothing was learned from it", id, seen.sentence)
      .of("batch")
      .with_text(id)
      .next("retrain --release if it is good");
}

std::function<bool(const std::string&, double)> JobRunner::reporter(const StoredJob& job, const StopRequests& stop) {
  auto reported = std::make_shared<std::chrono::steady_clock::time_point>();
  return [this, running = progress_at(job, JobStage::kTraining), reported, stop](const std::string& stage,
                                                                                 double share) mutable {
    const auto time = std::chrono::steady_clock::now();
    if (time >= *reported + kReportInterval) {
      *reported = time;
      running.what = stage;
      running.share = share;
      book_.report(running);
    }
    return !stop.any();
  };
}

TrainOptions JobRunner::train_options(const StoredJob& job, const StopRequests& stop) {
  TrainOptions options;
  if (!job.level.empty()) {
    options.level = job.level;
  } else if (const auto served = registry_.in_force(job.cell)) {
    options.level = level_with_additions(*cells_.at(job.cell), served->model);
  }
  if (!job.bias.empty()) options.bias = job.bias;
  options.seed = options_.seed;
  options.trained_at = unix_now();
  options.progress = reporter(job, stop);
  return options;
}

Status JobRunner::keep(Candidate candidate, const StopRequests& stop) {
  candidate.remarks += joined_by_semicolons(warnings_of(candidate.model, candidate.model.parts().validation));
  const auto kept = history_.keep(candidate, stop.service);
  if (!kept) return tl::make_unexpected(kept.error());
  JobProgress progress = progress_at(candidate.job, JobStage::kDone);
  progress.what = kept->message;
  progress.share = 1;
  progress.model_version = kept->version;
  progress.in_force = kept->in_force;
  progress.outcome = kept->outcome;
  book_.report(progress);
  return {};
}

void JobRunner::report_storing(const StoredJob& job) {
  JobProgress progress = progress_at(job, JobStage::kStoring);
  progress.share = 1;
  book_.report(progress);
}

Status JobRunner::finish(const StoredJob& job, const std::string& message, const JobOutcome& outcome) {
  if (const Status done = store_.set_job_done(job.id, message, outcome); !done) return done;
  JobProgress progress = progress_at(job, JobStage::kDone);
  progress.what = message;
  progress.outcome = outcome;
  progress.share = 1;
  book_.report(progress);
  return {};
}

}  // namespace trammel
