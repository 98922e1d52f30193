#include "server/trainer/compute/workbench.h"

#include <algorithm>
#include <utility>

#include "server/compensate/known_rows.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/compensate/paired_gain.h"
#include "server/diagnose/diagnose.h"
#include "server/diagnose/triage.h"
#include "server/report/diagnosis_json.h"
#include "server/report/diagnosis_page.h"
#include "server/report/health_json.h"
#include "server/tasks/accept/fits_cell.h"
#include "server/tasks/accept/verdict.h"
#include "server/tasks/check/check.h"
#include "server/tasks/train/extend.h"
#include "server/tasks/train/first_batch.h"
#include "server/tasks/train/lasting_sources.h"
#include "server/tasks/train/successor.h"

namespace trammel {

namespace {

std::string findings_text(const Diagnosis& diagnosis, const Cell& cell) {
  return diagnosis_json(diagnosis, notes_of(cell))
             .dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
         "\n";
}

/// The cell as it is served: with the error sources of the model in force.
std::shared_ptr<const Cell> as_served(const std::shared_ptr<const Cell>& cell,
                                      const ServedModel* in_force, const CheckedBatch& batch) {
  if (in_force == nullptr) return cell;
  auto served = std::make_shared<Cell>(*cell);
  served->model.error_sources = sources_in_force(in_force->model, *cell, batch);
  return served;
}

Made nothing_applied(const std::string& why, const ServedModel& present) {
  Made made;
  made.outcome.verdict = JobVerdict::kNothingApplied;
  made.outcome.why = why;
  made.outcome.next = "submit the batch where it is good, and release it";
  made.message =
      fmt::format("nothing applied: {}; version {} stays in force", why, present.version);
  return made;
}

bool has_unknown_tools(const CompensatedModel& model, const MeasurementBatch& batch) {
  return known_rows(model, batch).measurements.size() < batch.measurements.size();
}

/// True if `after` is better than `before` beyond chance, on the judging rows that both know.
bool is_better_on(const std::vector<JudgingSession>& sessions, const CompensatedModel& before,
                  const CompensatedModel& after) {
  std::vector<Vector3> errors_before, errors_after;
  std::vector<JointVector> q;
  for (const JudgingSession& session : sessions) {
    const Eigen::Matrix3Xd one = located_errors(before, session).position;
    const Eigen::Matrix3Xd other = located_errors(after, session).position;
    for (Eigen::Index i = 0; i < one.cols(); ++i) {
      if (!one.col(i).allFinite() || !other.col(i).allFinite()) continue;
      errors_before.emplace_back(one.col(i));
      errors_after.emplace_back(other.col(i));
      q.push_back(session.judges.measurements[static_cast<std::size_t>(i)].context.q);
    }
  }
  const auto n = static_cast<Eigen::Index>(errors_before.size());
  if (n == 0) return false;
  return paired_gain(Eigen::Map<const Eigen::Matrix3Xd>(errors_before.front().data(), 3, n),
                     Eigen::Map<const Eigen::Matrix3Xd>(errors_after.front().data(), 3, n),
                     pose_groups(q))
      .beyond_chance();
}

/// Adds `; ` before each text that is not empty.
std::string joined_by_semicolons(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) {
    if (!part.empty()) text += "; " + part;
  }
  return text;
}

Made nothing_carried(const DayGain& day) {
  Made made;
  made.outcome.verdict = JobVerdict::kNothingApplied;
  made.outcome.why = to_string(day);
  made.message = "nothing applied: " + made.outcome.why;
  return made;
}

/// The remarks on an extended model beside its verdict. `judged_less`: pose ids that did not
/// judge.
std::string remarks_of(const std::vector<std::string>& judged_less,
                       const std::vector<Unsupported>& left_out,
                       const std::optional<DayGain>& day) {
  return judged_without(judged_less) + joined_by_semicolons({to_string(left_out)}) +
         (day ? joined_by_semicolons({to_string(*day)}) : "");
}

HoldOut hold_out_of(const ComputeTask& task) {
  return kind_of(task.asked) != JobKind::kTrain
             ? held_out_of_diagnosis(task.validation_share, task.seed, is_to_train(task.asked))
             : held_out_by_service(task.validation_share, task.seed);
}

}  // namespace

Workbench::Workbench(ComputeTask task, BatchReads reads)
    : task_(std::move(task)),
      batches_(*task_.cell, hold_out_of(task_), std::move(reads), task_.batch_ids,
               task_.earlier_ids) {}

Status Workbench::take(const BatchText& batch, bool judges) {
  batches_.add(batch, judges);
  return {};
}

Result<Made> Workbench::make(const ComputeWatch& watch) {
  if (const auto* diagnosis = std::get_if<AskedDiagnosis>(&task_.asked))
    return diagnosed(*diagnosis, watch);
  if (const auto* check = std::get_if<AskedCheck>(&task_.asked)) return checked(*check, watch);
  return trained(std::get<AskedTraining>(task_.asked), watch);
}

Result<Made> Workbench::trained(const AskedTraining& asked, const ComputeWatch& watch) {
  const auto in_force = TRY(this->in_force());
  std::string seen;
  bool changed = false;
  if (task_.hold_against_in_force) {
    const auto batch = TRY(batches_.first());
    if (!in_force) {
      if (const auto doubt = doubt_of_first_batch(task_.cell, batch))
        return Made{std::nullopt, "", sentence(*doubt)};
    }
    if (in_force) {
      const Triage triaged = triage(in_force->model, batch);
      if (!triaged.learn) return Made{std::nullopt, "", triaged.sentence};
      changed = triaged.verdict != TriageVerdict::kClean;
      if (changed) seen = "the batch: " + triaged.sentence;
    }
  }
  const auto batch = TRY(batches_.to_learn_from());
  const bool as_usual = asked.level.empty() && asked.bias.empty();
  auto successor = TRY(train_successor(task_.cell, batch, as_usual ? in_force.get() : nullptr,
                                       train_options(batch, watch)));
  if (!task_.earlier_ids.empty()) {
    TRY(choose_alone(successor, changed, watch));
  }
  return made(std::move(successor.model), joined_by_semicolons({seen, successor.note}),
              batches_.judging_sessions());
}

Result<Made> Workbench::checked(const AskedCheck& asked, const ComputeWatch& watch) {
  const auto batch = TRY(batches_.first());
  const auto present = TRY(in_force());
  if (!present)
    return failure(ErrorCode::kNotFound, "the cell has no model in force to hold a check against");
  const HealthCheck check = TRY(check_robot(present->model, *task_.cell, batch,
                                            {asked.tolerance, false, task_.earlier_checks}));
  const auto json = check_json(check, batch, present->model);
  TRY(watch.found(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n",
                  ""));
  Made made;
  made.outcome.verdict = JobVerdict::kDiagnosed;
  made.outcome.why = check.sentence;
  made.message = to_string(check.verdict);
  return made;
}

Status Workbench::choose_alone(Successor& together, bool changed, const ComputeWatch& watch) {
  const auto own = TRY(batches_.first_without_older_judges());
  const bool adds_tools = in_force_ && has_unknown_tools(in_force_->model, own.rows());
  if (!changed && !adds_tools) return {};
  auto alone = train_successor(task_.cell, own, in_force_.get(), train_options(own, watch));
  if (!alone) return {};  // too little by itself
  const std::vector<JudgingSession>& sessions = batches_.judging_sessions();
  const auto session =
      std::find_if(sessions.begin(), sessions.end(),
                   [&](const JudgingSession& one) { return one.batch_id == own.id(); });
  const char* why = nullptr;
  if (changed && session != sessions.end() &&
      is_better_on({*session}, together.model, alone->model)) {
    why = "the arm has changed in more than one way: learned from this batch alone";
  } else if (!changed && !is_better_on(sessions, in_force_->model, together.model)) {
    why =
        "the sessions together are no better for the tools that were known: what was known stays, "
        "the new tool is added";
  }
  if (why == nullptr) return {};
  alone->note += (alone->note.empty() ? "" : "; ") + std::string(why);
  together = std::move(*alone);
  return {};
}

Result<Made> Workbench::diagnosed(const AskedDiagnosis& asked, const ComputeWatch& watch) {
  // The diagnosis must not see rows that judge an extended model.
  const auto batch = TRY(asked.apply ? batches_.first_without_older_judges() : batches_.first());
  const auto present = TRY(in_force());
  if (asked.apply && task_.batch_ids.empty() && present) {
    // A batch that was sent with the request is examined like a submitted one.
    const Triage triaged = triage(present->model, batch);
    if (!triaged.learn) return nothing_applied(triaged.sentence, *present);
  }
  DiagnoseOptions options;
  options.seed = task_.seed;
  options.progress = [&watch, whole = asked.apply ? kDiagnosisShare : 1](const std::string& stage,
                                                                         double share) {
    return watch.progress("diagnosing: " + stage, whole * share);
  };
  const auto served = as_served(task_.cell, present.get(), batch);
  const auto diagnosis = trammel::diagnose(served, batch, options);
  if (!diagnosis) return tl::make_unexpected(with_rows_set_aside(diagnosis.error(), batch));
  TRY(watch.found(findings_text(*diagnosis, *served), diagnosis_page(*diagnosis, *served)));
  Made made;
  made.outcome.verdict = JobVerdict::kDiagnosed;
  made.outcome.why = diagnosis->sentence;
  made.message = to_string(diagnosis->verdict);
  if (!asked.apply) return made;
  if (const Status can_apply = check_can_extend(*diagnosis); !can_apply) {
    const std::string stays =
        present ? fmt::format("; version {} stays in force", present->version) : "";
    made.outcome.verdict = JobVerdict::kNothingApplied;
    made.outcome.why = sentence(can_apply.error());
    made.message = "nothing applied: " + made.outcome.why + stays;
    return made;
  }
  return extended(batch, served->model.error_sources, *diagnosis, watch);
}

Result<Made> Workbench::extended(const CheckedBatch& batch, const std::vector<std::string>& own,
                                 const Diagnosis& diagnosis, const ComputeWatch& watch) {
  TrainOptions options = train_options(batch, watch);
  options.progress = [&watch](const std::string& stage, double share) {
    return watch.progress(stage, kDiagnosisShare + (1 - kDiagnosisShare) * share);
  };
  if (!in_force_) return first_extended(batch, diagnosis, options);
  auto extended = TRY(extended_model(task_.cell, own, batch, diagnosis, options));
  if (extended.day && !extended.day->carries()) return nothing_carried(*extended.day);
  auto found = TRY(batches_.sessions_of_diagnosis());
  MeasurementBatch& own_judges = found.sessions[found.own].judges;
  Judges judges = judges_of(diagnosis, std::move(own_judges));
  own_judges = std::move(judges.batch);
  const std::string remarks = remarks_of(judges.left_out, extended.left_out, extended.day);
  return made(std::move(extended.model), remarks, std::move(found.sessions));
}

Result<Made> Workbench::first_extended(const CheckedBatch& batch, const Diagnosis& diagnosis,
                                       const TrainOptions& options) {
  Extension extension = TRY(extend(task_.cell, batch, diagnosis, options));
  if (extension.day && !extension.day->carries()) return nothing_carried(*extension.day);
  without_ = std::make_shared<const ServedModel>(task_.cell->name, 0, std::move(extension.before));
  const std::string remarks =
      remarks_of(extension.gain.left_out, extension.left_out, extension.day);
  return made(std::move(extension.after), remarks, {std::move(extension.judges)});
}

TrainOptions Workbench::train_options(const CheckedBatch& batch, const ComputeWatch& watch) const {
  TrainOptions options;
  const auto* asked = std::get_if<AskedTraining>(&task_.asked);
  if (asked != nullptr && !asked->level.empty()) {
    options.level = asked->level;
  } else if (in_force_) {
    options.level = level_with_additions(*task_.cell, in_force_->model, batch.rows());
  }
  if (asked != nullptr && !asked->bias.empty()) options.bias = asked->bias;
  options.fleet = task_.fleet;
  options.seed = task_.seed;
  options.trained_at = task_.now;
  options.looked_at =
      true;  // by this job, or by the person who requested a training from known batches
  options.progress = watch.progress;
  return options;
}

Made Workbench::made(CompensatedModel model, std::string remarks,
                     std::vector<JudgingSession> sessions) {
  sessions_ = std::move(sessions);
  candidate_ = model;
  std::vector<std::string> texts;
  for (const Note& note : warnings_of(model, model.parts().validation))
    if (note.code != kNotConfirmed)
      texts.push_back(note.text);  // applies to every model of the cell; the cell's page says it
  remarks += joined_by_semicolons(texts);
  return {std::move(model), std::move(remarks), ""};
}

Result<GateVerdict> Workbench::judge(const Opponents& opponents) {
  std::shared_ptr<const ServedModel> present;
  if (opponents.in_force && in_force_ && in_force_->version == opponents.in_force->version) {
    present = in_force_;
  } else if (opponents.in_force) {
    auto model = TRY(loaded(*opponents.in_force));
    present = std::make_shared<const ServedModel>(std::move(model));
  }
  // The first model of its cell is compared with the same model without the findings, as with
  // files.
  if (!opponents.in_force && !opponents.record) present = without_;
  std::vector<ServedModel> before;
  for (const ModelText& text : opponents.served_before) {
    if (before.size() >= opponents.most_before) break;
    if (auto model = loaded(text)) before.push_back(std::move(*model));
  }
  const Bar bar =
      kind_of(task_.asked) == JobKind::kDiagnose ? Bar::kBetterBeyondChance : Bar::kBetter;
  return verdict_on(*candidate_, present.get(), std::move(before), opponents.record, sessions_,
                    {bar, task_.accept_ratio});
}

Result<std::shared_ptr<const ServedModel>> Workbench::in_force() {
  if (!task_.in_force || in_force_) return in_force_;
  auto model = TRY(loaded(*task_.in_force));
  in_force_ = std::make_shared<const ServedModel>(std::move(model));
  return in_force_;
}

Result<ServedModel> Workbench::loaded(const ModelText& text) const {
  const std::string which = fmt::format("version {} of cell {}", text.version, task_.cell->name);
  auto model = TRY(deserialize(text.text, which, ModelTexts::kAsTheyAre));
  TRY(check_fits_cell(model, *task_.cell, which));
  return ServedModel{task_.cell->name, text.version, std::move(model)};
}

}  // namespace trammel
