#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "server/base/units.h"
#include "server/compensate/model_notes.h"
#include "server/measurement/files/batch_file.h"
#include "server/trainer/acceptance/gate.h"
#include "server/trainer/pipeline/extend.h"
#include "server/trainer/trainer.h"

// What the trainer does with a batch that covers little and with a model that is trained: what is learned, what judges
// it, whether it goes in force.

namespace trammel {

namespace {

constexpr std::size_t kMostSessions = 50;     // newest batches that judge
constexpr std::size_t kMostServedBefore = 4;  // versions that a new one is held against besides the one in force

/// Why `batch` cannot replace all of `present`; empty where it can.
std::string narrower(const ServedModel& present, const MeasurementBatch& batch) {
  const CompensatedModel::Parts& parts = present.model.parts();
  std::vector<JointVector> poses;
  std::set<std::pair<std::string, std::string>> used;
  for (const Measurement& m : batch.measurements) {
    poses.push_back(m.context.q);
    used.emplace(m.context.tool, m.context.payload);
  }
  for (const auto& [tool, payload] : parts.trained_with) {
    if (!used.contains({tool, payload}))
      return fmt::format("the batch has no pose with tool '{}' and payload '{}'", tool, payload);
  }
  const double covered = coverage(poses, parts.q_min, parts.q_max);
  if (covered >= GateOptions::kLeastCoverage) return "";
  return fmt::format("the batch spreads over {:.0f} % of the joint ranges of version {} (limit {:.0f} %)",
                     100 * covered, present.version, 100 * GateOptions::kLeastCoverage);
}

/// Where among `sessions` those begin that came after `model` was trained: behind its own batches, or, where none of
/// these is among them, behind all that was measured before it.
std::size_t first_new(const std::vector<JudgingSession>& sessions, const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  const auto behind = [&](const auto& is_old) {
    return static_cast<std::size_t>(sessions.rend() - std::find_if(sessions.rbegin(), sessions.rend(), is_old));
  };
  const std::size_t own = behind([&](const JudgingSession& one) { return one.batch_id == provenance.batch_id; });
  if (own > 0) return own;
  const std::string several = "+" + provenance.batch_id + "+";  // joined by plus signs
  const std::size_t last =
      behind([&](const JudgingSession& one) { return several.find("+" + one.batch_id + "+") != std::string::npos; });
  if (last > 0) return last;
  const std::int64_t made_at = provenance.measured_at.value_or(provenance.trained_at);
  return behind([&](const JudgingSession& session) { return session.training.measured_at.value_or(0) <= made_at; });
}

/// The batches that a finished training of the cell was made from.
Result<std::set<std::string>> learned_from(const Store& store, const std::string& cell) {
  const auto jobs = store.recent_jobs(cell, std::numeric_limits<int>::max());
  if (!jobs) return tl::make_unexpected(jobs.error());
  std::set<std::string> learned;
  for (const StoredJob& job : *jobs) {
    if (job.state == JobState::kDone && job.model_version > 0)
      learned.insert(job.batch_ids.begin(), job.batch_ids.end());
  }
  return learned;
}

/// Where the version marked in force cannot be asked: against what its own held-out poses said when it was made.
GateVerdict judge_by_record(const CompensatedModel& candidate, const StoredModel& record,
                            const std::vector<JudgingSession>& sessions, double accept_ratio, GateVerdict otherwise) {
  double sum = 0;
  Eigen::Index count = 0;
  for (const JudgingSession& session : sessions) {
    const LocatedErrors errors = located_errors(candidate, session);
    for (Eigen::Index i = 0; i < errors.position.cols(); ++i) {
      if (!errors.position.col(i).allFinite()) continue;
      sum += errors.position.col(i).squaredNorm();
      ++count;
    }
  }
  const double rms = count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0;
  if (record.validation_rms == 0 || rms <= accept_ratio * record.validation_rms) return otherwise;
  return {false, fmt::format("not in force: held-out rms {:.4f} mm, limit {} x {:.4f} mm that version {} had on its "
                             "own, which is marked in force but cannot be loaded; activate it if it is wanted",
                             to_mm(rms), accept_ratio, to_mm(record.validation_rms), record.version)};
}

}  // namespace

Result<CompensatedModel> Trainer::trained(const StoredJob& job, const MeasurementBatch& batch, TrainOptions options,
                                          std::string& note) const {
  const std::shared_ptr<const Cell>& cell = cells_.at(job.cell);
  const auto present = registry_.in_force(job.cell);
  if (!present || !job.level.empty() || !job.bias.empty()) return train(cell, batch, options);
  const std::string why = narrower(*present, batch);
  if (why.empty()) return train(cell, batch, options);
  options.level.reset();
  options.from = present->model;
  auto refitted = train(cell, batch, options);
  if (!refitted && refitted.error().code == ErrorCode::kRefused) {
    options.refit = {"base"};
    refitted = train(cell, batch, options);
  }
  note += fmt::format("{}{}: {} refitted, the rest is that of version {}", note.empty() ? "" : "; ", why,
                      fmt::join(options.refit, " and "), present->version);
  return refitted;
}

Result<std::vector<JudgingSession>> Trainer::judging_sessions(const StoredJob& job) const {
  const Cell& cell = *cells_.at(job.cell);
  const auto batches = store_.batches(job.cell);
  if (!batches) return tl::make_unexpected(batches.error());
  const auto may_judge = learned_from(store_, job.cell);
  if (!may_judge) return tl::make_unexpected(may_judge.error());
  std::vector<JudgingSession> newest_first;
  for (auto batch = batches->rbegin(); batch != batches->rend() && newest_first.size() < kMostSessions; ++batch) {
    const bool own = std::find(job.batch_ids.begin(), job.batch_ids.end(), batch->id) != job.batch_ids.end();
    if (!own && (!batch->quarantine.empty() || !may_judge->contains(batch->id))) continue;
    const auto stored = store_.batch(job.cell, batch->id);
    if (!stored) return tl::make_unexpected(stored.error());
    const auto checked = checked_batch(*stored, cell);
    if (!checked) continue;  // the cell has changed since
    newest_first.push_back(judging_session(*checked, options_.validation_share, options_.seed));
  }
  std::reverse(newest_first.begin(), newest_first.end());
  judge_once(newest_first);
  return newest_first;
}

Result<std::vector<ServedModel>> Trainer::served_before(const std::string& cell_name) const {
  const auto versions = store_.previous_in_force(cell_name);
  std::vector<ServedModel> served;
  if (!versions) {
    if (versions.error().code == ErrorCode::kNotFound) return served;
    return tl::make_unexpected(versions.error());
  }
  for (const int version : *versions) {
    if (served.size() >= kMostServedBefore) break;
    if (auto model = load_for_service(cell_name, version)) served.push_back({cell_name, version, std::move(*model)});
  }
  return served;
}

Result<std::optional<StoredModel>> Trainer::record_not_loaded(const std::string& cell_name) const {
  if (registry_.in_force(cell_name)) return std::nullopt;
  const auto models = store_.models(cell_name);
  if (!models) return tl::make_unexpected(models.error());
  const auto marked = std::find_if(models->begin(), models->end(), [](const StoredModel& m) { return m.in_force; });
  // One that can be loaded was set aside for its robot or tools: its figures say nothing about others.
  if (marked == models->end() || store_.model(cell_name, marked->version)) return std::nullopt;
  return *marked;
}

Result<GateVerdict> Trainer::verdict(const CompensatedModel& model, const ServedModel* present,
                                     const std::vector<JudgingSession>& sessions, const std::string& cell_name,
                                     Bar bar) const {
  auto before = served_before(cell_name);
  if (!before) return tl::make_unexpected(before.error());
  GateQuestion question{model, present, std::move(*before), sessions, 0};
  if (present != nullptr) question.first_new = first_new(sessions, present->model);
  GateVerdict verdict = judge(question, {bar, options_.accept_ratio});
  if (!verdict.put_in_force) return verdict;
  const auto record = record_not_loaded(cell_name);
  if (!record) return tl::make_unexpected(record.error());
  if (*record) return judge_by_record(model, **record, sessions, options_.accept_ratio, std::move(verdict));
  return verdict;
}

Result<JudgingSession*> Trainer::session_of_diagnosis(const StoredJob& job,
                                                      std::vector<JudgingSession>& sessions) const {
  if (!job.batch_ids.empty()) {
    const auto own = std::find_if(sessions.begin(), sessions.end(), [&](const JudgingSession& session) {
      return session.batch_id == job.batch_ids.front();
    });
    if (own != sessions.end()) return &*own;
  }
  // It came with the question and is not stored, or is older than those that judge.
  const auto asked = store_.diagnosis(job.id);
  if (!asked) return tl::make_unexpected(asked.error());
  const auto batch = batch_to_diagnose(job, *asked, *cells_.at(job.cell));
  if (!batch) return tl::make_unexpected(batch.error());
  sessions.push_back(judging_session(*batch, options_.validation_share, options_.seed));
  judge_once(sessions);
  return &sessions.back();
}

Status Trainer::keep(const CompensatedModel& model, JobProgress progress, Bar bar, const std::string& note,
                     const Diagnosis* diagnosis) {
  progress.stage = JobStage::kStoring;
  progress.what.clear();
  progress.share = 1;
  report(progress);
  const auto job = store_.job(progress.job);
  if (!job) return tl::make_unexpected(job.error());
  auto sessions = judging_sessions(*job);
  if (!sessions) return tl::make_unexpected(sessions.error());
  std::string judged = note.empty() ? "" : "; " + note;
  for (const std::string& one : warnings_of(model, model.parts().validation)) judged += "; " + one;
  if (diagnosis != nullptr) {
    auto own = session_of_diagnosis(*job, *sessions);
    if (!own) return tl::make_unexpected(own.error());
    Judges judges = judges_of(*diagnosis, std::move((*own)->judges));
    (*own)->judges = std::move(judges.batch);
    judged = judged_without(judges.left_out) + judged;
  }
  const auto may_release = store_.may_release(job->id);
  if (!may_release) return tl::make_unexpected(may_release.error());
  for (;;) {
    // Judging takes a while: nobody waits for it. Where somebody changed what is in force meanwhile, it is done again.
    const auto present = registry_.in_force(progress.cell);
    auto verdict = this->verdict(model, present.get(), *sessions, progress.cell, bar);
    if (!verdict) return tl::make_unexpected(verdict.error());
    verdict->message += judged;
    const bool released = *may_release && (verdict->put_in_force || verdict->undecided);
    if (*may_release && !released)
      verdict->message += fmt::format("; what was in quarantine of {} stays there", fmt::join(job->batch_ids, ", "));
    const std::lock_guard lock(activation_mutex_);
    if (registry_.in_force(progress.cell) != present) continue;
    const auto version = store_.add_model(progress.cell, model, progress.job, verdict->put_in_force, verdict->message);
    if (!version) return tl::make_unexpected(version.error());
    for (const std::string& id : released ? job->batch_ids : std::vector<std::string>{}) {
      if (const Status free = store_.set_quarantine(progress.cell, id, ""); !free) return free;
    }
    const auto served = std::make_shared<const ServedModel>(ServedModel{progress.cell, *version, model});
    if (verdict->put_in_force) {
      put_in_force(served);
    } else if (on_model_) {
      on_model_(*served, false);
    }
    progress.what = verdict->message;
    progress.model_version = *version;
    progress.in_force = verdict->put_in_force;
    break;
  }
  progress.stage = JobStage::kDone;
  report(progress);
  return {};
}

}  // namespace trammel
